#pragma once

#include <CLI/CLI.hpp>

namespace lapservo::app {

/// For a number's option: the whole text is one finite number within [low, high], whole where the option's is. CLI11
/// alone takes nan through every range, -1 as an enormous unsigned and blanks as nothing. To be the option's first
/// check.
CLI::Validator number_between(double low, double high);
CLI::Validator whole_number_between(double low, double high);
/// Any finite number.
CLI::Validator finite_number();
/// A seed: any whole number of 53 bits.
CLI::Validator seed_number();

}  // namespace lapservo::app
