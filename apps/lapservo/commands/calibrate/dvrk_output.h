#pragma once

#include <optional>
#include <string>

#include "apps/lapservo/cli/subcommands.h"
#include "apps/lapservo/inputs/live_images.h"
#include "lapservo/core/atomic_file.h"
#include "lapservo/rig/joint_travel.h"
#include "lapservo/rig/rig.h"

namespace lapservo::app {

/// Options of `calibrate registration` for dVRK's software.
struct DvrkOptions {
  std::string base_frame, reference_frame = "camera", endoscope, set_base_frame;
};
void add_dvrk_options(Command command, DvrkOptions& options);

/// Before the job: throws InputError for what can't be done, and reads where the ECM stands. Then write().
class DvrkOutput {
 public:
  /// `has_joints`: whether the recording has them.
  DvrkOutput(const DvrkOptions& options, bool has_joints);
  /// `ranges`: of the joints' readings. Throws InputError as dvrk_base(), naming `source`.
  void write(const Instrument& instrument, const internal::JointRanges& ranges, const std::string& source);

 private:
  void publish(const Rigid3& camera_from_base);

  const DvrkOptions& options_;
  Transports transports_{"lapservo_calibrate"};
  std::optional<internal::AtomicFile> file_;
  std::optional<Rigid3> endoscope_;
};

}  // namespace lapservo::app
