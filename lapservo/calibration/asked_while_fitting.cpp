#include "lapservo/calibration/asked_while_fitting.h"

#include <utility>

namespace lapservo::internal {
namespace {

thread_local const AskedWhileFitting* innermost = nullptr;

}  // namespace

AskedWhileFitting::AskedWhileFitting(std::function<bool()> is_stopped)
    : is_stopped_(std::move(is_stopped)), outer_(innermost) {
  innermost = this;
}

AskedWhileFitting::~AskedWhileFitting() {
  innermost = outer_;
}

void AskedWhileFitting::ask() {
  if (innermost && innermost->is_stopped_) innermost->is_stopped_();
}

}  // namespace lapservo::internal
