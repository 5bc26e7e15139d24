#pragma once

#include <filesystem>
#include <optional>
#include <span>
#include <vector>

#include "lapservo/experiments/html_report.h"
#include "lapservo/experiments/setup.h"
#include "lapservo/experiments/statistics.h"
#include "lapservo/rcm/line_observation.h"

namespace lapservo {

/// The image of the RCM from where the shaft's centre lines meet, against the truth; ideal pixels. The paper has one
/// such estimate from 20 positions; here there are ten, each from 20 positions of its own.
struct RcmResult {
  static constexpr int sets = 10, positions = 20;

  struct Line {
    int set, position;
    Eigen::Vector2d from_px, to_px;  ///< e0 and e3
  };
  struct Estimate {
    int set;
    Eigen::Vector2d error_px;  ///< from the true RCM
    std::optional<Eigen::Matrix2d> covariance_px2;
  };
  /// The estimates of one estimator.
  struct Estimates {
    std::vector<Estimate> estimates;
    Spread distance;       ///< of the errors' lengths, pixels
    double in_sigmas = 0;  ///< rms of the error in units of its own covariance, by coordinate: 1 when honest
  };
  struct OfMethod {
    Method method;
    std::vector<Line> lines;
    Estimates pairwise;       ///< the paper's mean of intersections
    Estimates least_squares;  ///< weighted total least squares
    /// The estimator that belongs to the method.
    const Estimates& own() const { return method == Method::centerline ? pairwise : least_squares; }
  };
  Eigen::Vector2d true_px = Eigen::Vector2d::Zero();
  std::vector<OfMethod> methods;
};

/// The trackers do not know camera_from_rcm here. Throws InputError when the RCM has no image.
RcmResult measure_rcm(const ExperimentSetup& setup);

/// rcm.csv: every estimate; rcm_lines.csv: the lines behind them.
void write_data(const RcmResult& result, const std::filesystem::path& folder);

ReportSection section_of(const RcmResult& result, const ExperimentSetup& setup);

/// Sums up estimates that are there.
RcmResult::Estimates summed_up(std::vector<RcmResult::Estimate> estimates);

}  // namespace lapservo
