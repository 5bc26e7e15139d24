#pragma once

#include <filesystem>
#include <string>

#include "lapservo/core/atomic_file.h"
#include "lapservo/kinematics/rcm_kinematics.h"
#include "lapservo/rig/rig.h"

namespace lapservo::internal {

/// The truth.csv beside rendered frames: what is where, per frame and instrument. The columns of ../shared/frames.
class TruthCsv {
 public:
  explicit TruthCsv(const std::filesystem::path& path);
  /// The instrument must have camera_from_rcm, and its marker lie before the camera (else std::invalid_argument).
  void add(const std::string& file, const std::string& condition, const Camera& camera, const Instrument& instrument,
           const JointVector& q);
  void commit() { file_.commit(); }

 private:
  AtomicFile file_;
};

}  // namespace lapservo::internal
