#pragma once

#include "lapservo/vision/model/print_doubt.h"

namespace lapservo::internal {

/// What residuals say about the print's errors: the Gaussian likelihood exp(gradient . x - x . information x / 2), x in
/// millimetres.
struct PrintInformation {
  PrintMatrix information = PrintMatrix::Zero();  ///< positive semi-definite
  PrintVector gradient = PrintVector::Zero();
};

/// What they say when such shapes of unknown size (one sigma each) may be in them: the covariance that the information
/// stands for grows by them (the Woodbury identity, a shape at a time).
PrintInformation doubted(PrintInformation print, const PrintShapes& shapes_mm);

/// What is assumed of the print's errors [mm]: each by itself, and where an ink lies aside both inner boundaries alike
/// as well, which looks most like a turn: the covariance sigma^2 (I + c c^T), c the inner boundaries' shift.
struct PrintPrior {
  double sigma_mm = 0;
  bool ink_aside = false;
};

/// The covariance of the print's errors that a prior and the information, in which no boundary has to do with another,
/// leave [mm^2].
PrintMatrix covariance_of(const PrintMatrix& information_by_boundary, const PrintPrior& prior);

/// How likely residuals make prints of any size of errors.
class PrintEvidence {
 public:
  explicit PrintEvidence(const PrintInformation& print);

  /// Logarithm of the likelihood of such a print, compared with an exact one's.
  double gain(const PrintPrior& prior) const;

 private:
  PrintInformation alone_, ink_aside_;  // of errors whose prior is the same in all directions
};

}  // namespace lapservo::internal
