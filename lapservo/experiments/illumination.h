#pragma once

#include <array>
#include <filesystem>
#include <vector>

#include <opencv2/core.hpp>

#include "lapservo/experiments/html_report.h"
#include "lapservo/experiments/setup.h"
#include "lapservo/experiments/statistics.h"
#include "lapservo/vision/observation.h"

namespace lapservo {

/// The paper's section V-B: do the four points stay where they are when the light changes?
struct IlluminationResult {
  static constexpr int positions = 20;
  static constexpr std::array<double, 4> lights{0.4, 0.6, 0.8, 1.0};
  static constexpr double paper_mean_px = 1.49;

  struct Point {
    int position, light, point;  ///< light: index into `lights`; point: 0 to 3, of e0 to e3
    Eigen::Vector2d raw_px;
    double to_centroid_px;  ///< distance to the centroid of this point over the lights it was found under
    double to_truth_px;
  };
  struct OfMethod {
    Method method;
    int found = 0;  ///< frames, of positions x lights
    std::vector<Point> points;
    Spread to_centroid, to_truth;  ///< pixels
  };
  std::vector<OfMethod> methods;
  cv::Mat example_bgr;  ///< the first position under all lights, with what the last method saw
};

IlluminationResult measure_illumination(const ExperimentSetup& setup);

/// illumination.csv: every point.
void write_data(const IlluminationResult& result, const std::filesystem::path& folder);

ReportSection section_of(const IlluminationResult& result, const ExperimentSetup& setup);

}  // namespace lapservo
