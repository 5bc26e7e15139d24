#pragma once

/// The public interface of programs that measure or steer an instrument. Units and frames: docs/frames.md; a robot, a
/// camera or a trajectory of your own: docs/extending.md. Names in lapservo::internal may change at any time.

// Errors of files and configurations; names of joints and image features.
#include "lapservo/core/error.h"
#include "lapservo/core/joint_vector.h"

// The scene before the camera: load_rig(), Rig, Camera, Marker.
#include "lapservo/geometry/camera.h"
#include "lapservo/geometry/response.h"
#include "lapservo/geometry/rigid3.h"
#include "lapservo/kinematics/features.h"
#include "lapservo/kinematics/rcm_kinematics.h"
#include "lapservo/marker/marker.h"
#include "lapservo/rig/rig.h"
#include "lapservo/tool/tool.h"

// A marker for a shaft, what to expect of it, a sheet to print.
#include "lapservo/marker/design.h"
#include "lapservo/marker/drawing.h"
#include "lapservo/marker/sensitivity.h"

// Measurement: Tracker makes Observations of images, which come from files, videos and cameras.
#include "lapservo/io/frame_source.h"
#include "lapservo/io/image_file.h"
#include "lapservo/io/overlay.h"
#include "lapservo/vision/observation.h"
#include "lapservo/vision/status.h"
#include "lapservo/vision/tracker.h"

// Where the RCM appears in the image, from the lines on which an instrument was seen.
#include "lapservo/rcm/distinct_lines.h"
#include "lapservo/rcm/line_observation.h"
#include "lapservo/rcm/projected_rcm.h"

// The ports, to be implemented for an arm and a camera: Robot, ImageStream, Clock; Supervisor before every arm.
#include "lapservo/robot/blocked.h"
#include "lapservo/robot/clock.h"
#include "lapservo/robot/joint_path.h"
#include "lapservo/robot/operating_state.h"
#include "lapservo/robot/reading_buffer.h"
#include "lapservo/robot/robot.h"
#include "lapservo/robot/steady_clock.h"
#include "lapservo/robot/supervisor.h"
#include "lapservo/robot/supervisor_state.h"
#include "lapservo/robot/suspension_watch.h"
#include "lapservo/stream/endoscope_pose.h"
#include "lapservo/stream/image_stream.h"

// Control: run() follows a Trajectory with a ControllerConfig and passes each ControlTick to a RunObserver.
#include "lapservo/control/control_step.h"
#include "lapservo/control/controller_config.h"
#include "lapservo/control/estimate.h"
#include "lapservo/control/feature_model.h"
#include "lapservo/control/hold_reason.h"
#include "lapservo/control/image_measurement.h"
#include "lapservo/control/paper_trajectory.h"
#include "lapservo/control/trajectory.h"
#include "lapservo/control/trajectory_check.h"
#include "lapservo/servo/controller_file.h"
#include "lapservo/servo/image_features.h"
#include "lapservo/servo/image_window.h"
#include "lapservo/servo/run.h"
#include "lapservo/servo/servo_decision.h"
#include "lapservo/servo/tracked_image.h"

// In place of arm and camera: Simulator, and the Renderer behind it.
#include "lapservo/sim/arm.h"
#include "lapservo/sim/endoscope.h"
#include "lapservo/sim/renderer.h"
#include "lapservo/sim/scene.h"
#include "lapservo/sim/simulated_arm.h"
#include "lapservo/sim/simulator.h"
