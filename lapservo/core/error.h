#pragma once

#include <memory>
#include <stdexcept>
#include <string>
#include <string_view>

namespace lapservo {

/// A problem with one field of a configuration.
struct FieldProblem {
  std::string field, value, expectation;

  /// field: is value, expected expectation
  std::string text() const;
};

/// A configuration or an input that can't be used: thrown once, early. what() is one line naming source (a file, or an
/// option), field, value and expectation, for example
///   rig.yaml: instruments[0].marker.diameter_m: is -1, expected a number above 0
class InputError : public std::runtime_error {
 public:
  InputError(std::string_view source, std::string_view field, std::string_view value, std::string_view expected);
  InputError(std::string_view source, const FieldProblem& problem);
  /// For a source that has no fields: `source: problem`.
  InputError(std::string_view source, std::string_view problem);

  /// As they were given, whatever what() makes of them. Empty: field(), value() and expectation() where the source has
  /// no fields, problem() where it has.
  const std::string& source() const { return parts_->source; }
  const std::string& field() const { return parts_->field; }
  const std::string& value() const { return parts_->value; }
  const std::string& expectation() const { return parts_->expectation; }
  const std::string& problem() const { return parts_->problem; }

  /// The same of another source: for those who know the name of the file whose content something else refused.
  InputError with_source(std::string_view source) const;

 private:
  struct Parts {
    std::string source, field, value, expectation, problem;
  };
  std::shared_ptr<const Parts> parts_;  // shared: exceptions are copied where nothing may throw
};

}  // namespace lapservo
