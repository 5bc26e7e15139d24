#pragma once

#include <string>

#include "lapservo/core/error.h"

namespace lapservo::testing {

/// The message of the InputError that `call` throws; another exception passes, and none gives an empty text.
template <typename Call>
std::string input_error(const Call& call) {
  try {
    call();
  } catch (const InputError& error) {
    return error.what();
  }
  return {};
}

}  // namespace lapservo::testing
