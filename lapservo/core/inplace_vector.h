#pragma once

#include <cstddef>
#include <memory>
#include <new>
#include <stdexcept>
#include <type_traits>

namespace lapservo::internal {

/// A vector of up to `Capacity` elements that lives where it is declared: what a frame's work gathers, without the
/// heap. For plain elements, which need no destruction.
template <typename T, std::size_t Capacity>
class InplaceVector {
  static_assert(std::is_trivially_destructible_v<T>);

 public:
  InplaceVector() = default;
  InplaceVector(const InplaceVector& other) { *this = other; }
  InplaceVector& operator=(const InplaceVector& other) {
    if (this == &other) return *this;
    std::uninitialized_copy(other.begin(), other.end(), begin());
    size_ = other.size_;
    return *this;
  }
  ~InplaceVector() = default;

  /// std::length_error when full.
  void push_back(const T& value) {
    if (size_ == Capacity) throw std::length_error("InplaceVector is full");
    ::new (static_cast<void*>(begin() + size_)) T(value);
    ++size_;
  }
  /// A new last element, to be filled where it is.
  T& emplace_back() {
    if (size_ == Capacity) throw std::length_error("InplaceVector is full");
    return *::new (static_cast<void*>(begin() + size_++)) T();
  }
  void pop_back() { --size_; }
  void clear() { size_ = 0; }

  std::size_t size() const { return size_; }
  bool empty() const { return size_ == 0; }
  T* begin() { return std::launder(reinterpret_cast<T*>(storage_)); }
  T* end() { return begin() + size_; }
  const T* begin() const { return std::launder(reinterpret_cast<const T*>(storage_)); }
  const T* end() const { return begin() + size_; }
  T& operator[](std::size_t i) { return begin()[i]; }
  const T& operator[](std::size_t i) const { return begin()[i]; }

 private:
  alignas(T) std::byte storage_[sizeof(T) * Capacity];
  std::size_t size_ = 0;
};

}  // namespace lapservo::internal
