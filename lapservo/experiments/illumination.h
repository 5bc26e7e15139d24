#pragma once

#include <array>
#include <filesystem>
#include <vector>

#include <opencv2/core.hpp>

#include "lapservo/experiments/setup.h"
#include "lapservo/experiments/statistics.h"
#include "lapservo/report/html_report.h"
#include "lapservo/vision/observation.h"

namespace lapservo::internal {

/// The paper's section V-B: do the four points stay where they are when the lamps are turned down?
struct IlluminationResult {
  static constexpr int positions = 20;
  static constexpr std::array<double, 4> lights{0.4, 0.6, 0.8, 1.0};  ///< fractions of the lamps' full power
  static constexpr double paper_mean_px = 1.49, paper_deviation_px = 1.23;

  /// One measurement.
  struct Point {
    int position, light, point;  ///< light: index into `lights`; point: 0 to 3, of e0 to e3
    Eigen::Vector2d raw_px;
    double to_centroid_px;  ///< distance to the centroid of this point over the lights it was found under; NaN of one
    double to_truth_px;
  };
  /// The paper's figure for one point in one position, found under every light.
  struct Largest {
    int position, point;
    double px;  ///< the largest distance of the measurements to their centroid
  };
  struct OfMethod {
    Method method;
    std::vector<Point> points;
    std::vector<Largest> largest;
    Spread of_largest;             ///< the paper's mean and standard deviation, pixels
    Spread to_centroid, to_truth;  ///< of every measurement, pixels
  };
  std::vector<OfMethod> methods;
  cv::Mat example_bgr;  ///< the first position under all lights, with what the last method saw
};

/// The trackers do not know camera_from_rcm here: it would hold the shaft where it is.
IlluminationResult measure_illumination(const ExperimentSetup& setup);

/// Sums up measurements that are there.
IlluminationResult::OfMethod summed_up(Method method, std::vector<IlluminationResult::Point> points);

/// illumination.csv: every measurement; illumination_largest.csv: the largest distance of each point.
void write_data(const IlluminationResult& result, const std::filesystem::path& folder);

ReportSection section_of(const IlluminationResult& result, const ExperimentSetup& setup);

}  // namespace lapservo::internal
