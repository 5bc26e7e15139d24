#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include <opencv2/core.hpp>

#include "lapservo/calibration/check/rig_check.h"
#include "lapservo/calibration/check/work_space.h"

namespace lapservo::app {

/// All that `check` found out.
struct CheckedRig {
  internal::RigFindings findings;
  std::vector<internal::FrameEvidence> frames;
  std::vector<internal::SigmaMap> maps;
  std::vector<internal::Advice> advice;
  std::string exact_registration;  ///< exact_registration_text()
  std::string tip;                 ///< how well it is known, or why not; empty without a tool
  /// A frame of each kind with the pixels that have a band's hue painted (segmentation_picture); empty without such a
  /// frame.
  cv::Mat found_segmented, missed_segmented;

  bool good_enough() const;
};

/// One line a topic: its name and what was found.
struct CheckLine {
  std::string name, found;
};
std::vector<CheckLine> check_lines(const CheckedRig& checked);

/// "good enough", or "not good enough: " and what to do first.
std::string verdict_of(const CheckedRig& checked);

/// Where that holds.
std::string region_of(const CheckedRig& checked);

/// One HTML page. Throws InputError when it can't be written.
void write_check_report(const std::filesystem::path& path, const std::string& instrument, const CheckedRig& checked);

}  // namespace lapservo::app
