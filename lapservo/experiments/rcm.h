#pragma once

#include <filesystem>
#include <optional>
#include <vector>

#include "lapservo/experiments/setup.h"
#include "lapservo/experiments/statistics.h"
#include "lapservo/rcm/line_observation.h"
#include "lapservo/report/html_report.h"

namespace lapservo::internal {

/// The paper's section V-B, second half: the image of the RCM from where the shaft's centre lines meet, against the
/// truth, with the RCM in view; ideal pixels. The paper has one set of 20 positions; here there are ten.
struct RcmResult {
  static constexpr int sets = 10, positions = 20, pairs = positions * (positions - 1) / 2;
  static constexpr double paper_mean_px = 3.62, paper_deviation_px = 2.13;

  struct Line {
    int set, position;
    Eigen::Vector2d from_px, to_px;  ///< e0 and e3
  };
  /// Where two lines of a set meet: what the paper measures.
  struct Intersection {
    int set, first, second;  ///< positions
    Eigen::Vector2d px;
    double distance_px;  ///< from the true RCM
    double angle_rad;    ///< between the lines, 0 to pi/2
  };
  struct Estimate {
    int set;
    Eigen::Vector2d error_px;  ///< from the true RCM
    std::optional<Eigen::Matrix2d> covariance_px2;
  };
  /// The estimates of one estimator.
  struct Estimates {
    std::vector<Estimate> estimates;
    Spread distance;  ///< of the errors' lengths, pixels
    /// rms of the error in units of its own covariance, by coordinate: ideally 1; NaN where none has a covariance
    double in_sigmas = std::nan("");
  };
  struct OfMethod {
    Method method;
    std::vector<Line> lines;
    std::vector<Intersection> intersections;
    Spread distance;          ///< of the intersections, pixels
    Estimates pairwise;       ///< the paper's mean of intersections (eq. 9)
    Estimates least_squares;  ///< weighted total least squares
  };
  Rig rig;  ///< that was used
  Eigen::Vector2d true_px = Eigen::Vector2d::Zero();
  std::vector<OfMethod> methods;
};

/// The rig itself when its RCM lies in the image; otherwise the same rig with the RCM moved to 100 mm before the
/// camera, near the upper left corner, without rotation.
Rig with_rcm_in_view(Rig rig);

/// On with_rcm_in_view(setup.rig). The trackers do not know camera_from_rcm here.
RcmResult measure_rcm(const ExperimentSetup& setup);

/// rcm_intersections.csv: every intersection; rcm.csv: every estimate; rcm_lines.csv: the lines behind them.
void write_data(const RcmResult& result, const std::filesystem::path& folder);

ReportSection section_of(const RcmResult& result, const ExperimentSetup& setup);

/// All intersections of the lines of each set.
std::vector<RcmResult::Intersection> intersections_of(const std::vector<RcmResult::Line>& lines,
                                                      const Eigen::Vector2d& true_px);

/// Sums up estimates that are there.
RcmResult::Estimates summed_up(std::vector<RcmResult::Estimate> estimates);

}  // namespace lapservo::internal
