#pragma once

#include <span>

#include "lapservo/vision/model/print_doubt.h"

namespace lapservo::internal {

/// The residuals' evidence about the print's errors: the Gaussian likelihood exp(gradient . x - x . information x / 2),
/// x in millimetres.
struct PrintInformation {
  PrintMatrix information = PrintMatrix::Zero();  ///< positive semi-definite
  PrintVector gradient = PrintVector::Zero();
};

/// Their evidence when such shapes of unknown size (one sigma each) may be in them: the covariance that the information
/// stands for grows by them (the Woodbury identity, a shape at a time).
PrintInformation doubted(PrintInformation print, std::span<const PrintVector> shapes_mm);

/// How large the print's errors are (one sigma) [mm]: each by itself, and both inner boundaries' alike, since the
/// middle ink lies aside, which looks most like a turn. Their covariance is bands^2 I + ink^2 c c^T, c the inner
/// boundaries' shift.
struct PrintPrior {
  double bands_mm = 0, ink_mm = 0;
};

/// The covariance of the print's errors that a prior and the information, in which no boundary has to do with another,
/// leave [mm^2]. Bands are taken to be off by a picometre at least, by a micrometre where the ink lies aside.
PrintMatrix covariance_of(const PrintMatrix& information_by_boundary, const PrintPrior& prior);

/// How likely residuals make prints of any size of errors.
class PrintEvidence {
 public:
  explicit PrintEvidence(const PrintInformation& print);

  /// Logarithm of the likelihood of such a print, compared with an exact one's.
  double gain(const PrintPrior& prior) const;

 private:
  PrintInformation print_;
  PrintVector by_ink_;  // information * c
  double ink_ = 0;      // c^T information c
};

}  // namespace lapservo::internal
