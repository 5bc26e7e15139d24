#include "lapservo/calibration/registration/joint_faults.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <Eigen/Geometry>
#include <fmt/format.h>

#include "lapservo/core/angles.h"
#include "lapservo/core/statistics.h"

namespace lapservo::internal {
namespace {

bool is_length(std::size_t joint) {
  return joint == 2;
}

double frame_period_s(const std::vector<TimedPose>& poses) {
  std::vector<double> periods_s;
  for (std::size_t i = 1; i < poses.size(); ++i) periods_s.push_back(poses[i].time_s - poses[i - 1].time_s);
  return periods_s.empty() ? 1 : median(periods_s);
}

// From turns for radians to radians for turns, in steps after which the sign of a joint that turns once still shows.
std::vector<double> scale_starts() {
  constexpr int steps = 8, steps_of_two = 3;
  std::vector<double> starts{0};
  for (int k = 1; k <= steps; ++k) {
    const double times = std::exp2(static_cast<double>(k) / steps_of_two);
    starts.insert(starts.end(), {times - 1, 1 / times - 1});
  }
  return starts;
}

JointFault scale_fault(const std::string& name, std::size_t j) {
  return {[=](double size) {
            return fmt::format(
                "{} moves by {:.3f} times its readings: check its unit, its gear and its encoder's scale{}", name,
                1 + size, is_length(j) ? ", and the marker's diameter_m, by which depths are measured" : "");
          },
          [j](JointRecording& r, double size) {
            for (auto& at : r.joints) at[j] *= 1 + size;
          },
          1e-4,
          0,
          scale_starts(),
          0,
          true};
}

JointFault coupling_fault(const Joints& joints, std::size_t j, std::size_t by) {
  return {[joints, j, by](double size) {
            return fmt::format(
                "{} moves with the readings of {} too, by {:.3g} {}: these joints are coupled; record the joints' "
                "positions, not the motors'",
                joints.names[j], joints.names[by], size, is_length(j) ? "m/rad" : "rad/rad");
          },
          [j, by](JointRecording& r, double size) {
            for (auto& at : r.joints) at[j] += size * at[by];
          },
          is_length(j) ? 1e-5 : 1e-4};
}

JointFault incision_fault(const std::string& name, std::size_t j, int along) {
  const auto text = [=](double size) {
    return fmt::format("the incision gives: the RCM moves with {}, by {:.2g} mm/rad: swing with less force, less far",
                       name, 1e3 * std::abs(size));
  };
  return {.text = text, .mend = {}, .step = 1e-4, .least = 3e-4, .gives_with = j, .along = along};
}

JointFault lag_fault(const std::string& name, std::size_t j) {
  return {[=](double size) {
            return fmt::format("the readings of {} are {:.0f} ms {} than the other joints': stamp all joints alike",
                               name, 1e3 * std::abs(size), size > 0 ? "later" : "earlier");
          },
          [j](JointRecording& r, double size) {
            const JointRecording before = r;
            for (std::size_t i = 0; i < r.joints.size(); ++i)
              if (const auto at = before.at(r.time_s[i] + size)) r.joints[i][j] = (*at)[j];
          },
          1e-3};
}

// To second order: to the first one, a filter is a delay.
JointFault filter_fault() {
  constexpr double apart_s = 0.2;  // shorter, the noise of readings would count
  return {[](double size) {
            return fmt::format("a filter of about {:.0f} ms lies between joints and readings: record them unfiltered",
                               1e3 * std::sqrt(2 * std::abs(size)));
          },
          [](JointRecording& r, double size) {
            const JointRecording is = r;
            for (std::size_t i = 0; i < is.joints.size(); ++i) {
              const auto before = is.at(is.time_s[i] - apart_s), after = is.at(is.time_s[i] + apart_s);
              for (std::size_t j = 0; before && after && j < 4; ++j)
                r.joints[i][j] -= size * ((*before)[j] - 2 * is.joints[i][j] + (*after)[j]) / (apart_s * apart_s);
            }
          },
          1e-5};
}

// Sizes for the usual rates of cameras and of folders.
std::vector<double> clock_starts(double images_per_s) {
  std::vector<double> starts{0};
  for (const double rate : {5.0, 6.0, 7.5, 8.0, 10.0, 12.5, 15.0, 20.0, 24.0, 25.0, 30.0, 50.0, 60.0})
    if (std::abs(rate / images_per_s - 1) > 0.02) starts.push_back(rate / images_per_s - 1);
  return starts;
}

// `from_s`: a frame's stamp; `delay_s`: by which it is later than the joints' clock.
JointFault lost_frames_fault(double from_s, double delay_s) {
  constexpr double least_lost_s = 8e-3;  // half a frame of the fastest cameras
  return {[=](double size) {
            return fmt::format(
                "from about {:.1f} s on, images are stamped {:.0f} ms {}: frames are {} there; record again without "
                "lost frames",
                from_s, 1e3 * std::abs(size), size < 0 ? "too early" : "too late", size < 0 ? "missing" : "repeated");
          },
          [from_s, delay_s](JointRecording& r, double size) {
            double last_s = r.time_s.front();
            for (double& time_s : r.time_s) {
              if (time_s > from_s - delay_s) time_s = std::max(time_s + size, last_s + 1e-6);
              last_s = time_s;
            }
          },
          1e-3, least_lost_s};
}

void unwrap(JointRecording& r) {
  for (std::size_t j = 0; j < 4; ++j) {
    if (is_length(j)) continue;
    double turns = 0;
    for (std::size_t i = 1; i < r.joints.size(); ++i) {
      const double step = r.joints[i][j] + turns - r.joints[i - 1][j];
      turns -= two_pi * std::round(step / two_pi);
      r.joints[i][j] += turns;
    }
  }
}

// The first of each run of equal readings is when it was read.
void drop_repeated(JointRecording& r) {
  JointRecording fresh;
  for (std::size_t i = 0; i < r.joints.size(); ++i)
    if (i == 0 || i + 1 == r.joints.size() || r.joints[i] != r.joints[i - 1])
      fresh.time_s.push_back(r.time_s[i]), fresh.joints.push_back(r.joints[i]);
  r.time_s = fresh.time_s, r.joints = fresh.joints;
}

}  // namespace

JointFault focal_fault() {
  return {[](double longer) {
            return fmt::format("the rig's focal length is {:.3g} times the camera's: lapservo calibrate camera",
                               1 / (1 + longer));
          },
          {},
          1e-4,
          0,
          {-0.4, -0.2, 0, 0.25, 0.6},
          0.3};
}

std::vector<TimedPose> with_focal(std::vector<TimedPose> poses, double longer) {
  for (TimedPose& pose : poses) {
    const Eigen::Vector3d axis = pose.axis(), along_view(0, 0, axis.z());
    Rigid3& camera_from_marker = pose.marker.camera_from_marker;
    camera_from_marker.translation.z() *= 1 + longer;
    const Eigen::Quaterniond turn = Eigen::Quaterniond::FromTwoVectors(axis, axis + longer * along_view);
    camera_from_marker.rotation = (turn * camera_from_marker.rotation).normalized();
    pose.by_focal = {{0, 0, pose.origin().z()}, pose.axis().cross(Eigen::Vector3d(0, 0, pose.axis().z()))};
  }
  return poses;
}

JointFault clock_fault(const std::vector<TimedPose>& poses) {
  const double period_s = frame_period_s(poses);
  return {
      [=](double size) {
        return fmt::format(
            "the images' clock runs {:.4f} times as fast as the joints': if they are {:.4g} images a second, read as "
            "{:.4g}, give --fps for a folder, or write the video anew at its own rate; else stamp both by one clock",
            1 + size, (1 + size) / period_s, 1 / period_s);
      },
      [](JointRecording& r, double size) {
        const double first_s = r.time_s.front();
        for (double& time_s : r.time_s) time_s = first_s + (1 + size) * (time_s - first_s);
      },
      1e-4, 0, clock_starts(1 / period_s)};
}

std::vector<JointFault> sized_joint_faults(const Joints& joints, const std::vector<TimedPose>& poses, double delay_s) {
  constexpr int parts = 8;
  std::vector<JointFault> faults;
  for (std::size_t j = 0; j < 4; ++j) {
    faults.push_back(scale_fault(joints.names[j], j)), faults.push_back(lag_fault(joints.names[j], j));
    for (std::size_t by = 0; by < 4; ++by)
      if (by != j && !is_length(by)) faults.push_back(coupling_fault(joints, j, by));
    for (int along = 0; j < 2 && along < 3; ++along) faults.push_back(incision_fault(joints.names[j], j, along));
  }
  faults.push_back(clock_fault(poses)), faults.push_back(focal_fault()), faults.push_back(filter_fault());
  const double first_s = poses.front().time_s, span_s = poses.back().time_s - first_s;
  for (int part = 1; part < parts; ++part)
    faults.push_back(lost_frames_fault(first_s + span_s * part / parts, delay_s));
  return faults;
}

std::vector<JointFault> other_joint_faults(const Joints& joints) {
  std::vector<JointFault> faults;
  for (std::size_t j = 0; j < 4; ++j)
    for (std::size_t k = j + 1; k < 4; ++k)
      faults.push_back({[joints, j, k](double) {
                          return fmt::format("{} and {} are exchanged: joints.names has theta, phi, rho, psi",
                                             joints.names[j], joints.names[k]);
                        },
                        [j, k](JointRecording& r, double) {
                          for (auto& at : r.joints) std::swap(at[j], at[k]);
                        }});
  faults.push_back({[](double) { return std::string("an angle wraps: record it without jumps of a turn"); },
                    [](JointRecording& r, double) { unwrap(r); }});
  faults.push_back(
      {[](double) {
         return std::string(
             "readings are held: each is there several times; record them at the rate at which they are new");
       },
       [](JointRecording& r, double) { drop_repeated(r); }});
  return faults;
}

}  // namespace lapservo::internal
