#include "lapservo/vision/tracker.h"

#include <memory>
#include <mutex>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "lapservo/calibration/recording/frame_recording.h"
#include "lapservo/core/error.h"
#include "lapservo/io/frame_source.h"
#include "lapservo/io/image_file.h"
#include "lapservo/io/overlay.h"
#include "lapservo/io/pictures/png_picture.h"
#include "lapservo/kinematics/centre_line.h"
#include "lapservo/rig/instruments.h"
#include "lapservo/rig/registration_covariance.h"
#include "python/src/bindings.h"
#include "python/src/conversions.h"
#include "python/src/observed.h"
#include "python/src/python_frames.h"
#include "python/src/state.h"

namespace lapservo::python {
namespace {

using Points = Eigen::Matrix<double, 4, 2, Eigen::RowMajor>;

Points points_of(const std::array<Eigen::Vector2d, 4>& edges) {
  Points points;
  for (int i = 0; i < 4; ++i) points.row(i) = edges[static_cast<std::size_t>(i)].transpose();
  return points;
}

bool is_ok(const Observed& seen) {
  return seen.observation.status == Status::ok;
}

// The member of lapservo.Status, which is Python's own kind of enumeration.
py::object status_to_python(Status status) {
  return py::module_::import("lapservo._status").attr("Status")(std::string(to_string(status)));
}

// Numbers mean something of an observation that is ok only; of others they are None. `read`: a function of what was
// observed, or a member of the observation.
template <typename Read>
auto when_ok(Read read) {
  return [read](const Observed& seen) {
    const auto value = [&] {
      if constexpr (std::is_invocable_v<Read, const Observed&>)
        return read(seen);
      else
        return seen.observation.*read;
    };
    return is_ok(seen) ? read_only(py::cast(value())) : py::none();
  };
}

std::optional<Eigen::Vector4d> q_of(const Observed& seen) {
  const auto& rcm = seen.observation.rcm;
  return rcm ? std::optional(rcm->q.vector()) : std::nullopt;
}

std::optional<Eigen::Matrix4d> q_covariance_of(const Observed& seen) {
  const auto& rcm = seen.observation.rcm;
  return rcm ? std::optional(rcm->covariance) : std::nullopt;
}

Eigen::Vector4d features_of(const Observed& seen) {
  const Features& f = seen.observation.features;
  return {f.s_rad, f.r_px.value_or(std::numeric_limits<double>::quiet_NaN()), f.l_px, f.d_px};
}

Eigen::Matrix4d features_covariance_of(const Observed& seen) {
  const Observation& o = seen.observation;
  const Camera& camera = seen.rig->camera;
  const auto index = internal::instrument_index(*seen.rig, o.instrument);
  const Instrument instrument = index ? seen.rig->instruments[*index] : Instrument{};
  std::optional<Eigen::Vector2d> rcm;
  Eigen::Matrix2d of_rcm = Eigen::Matrix2d::Zero();
  if (const auto& at = instrument.camera_from_rcm; at && o.features.r_px) {
    rcm = internal::projected_rcm_px(camera, *at);
    const auto registered = internal::registration_covariance(instrument);
    if (rcm) of_rcm = internal::projected_rcm_covariance_px2(camera, *at, registered.topLeftCorner<3, 3>());
  }
  Eigen::Matrix4d covariance = internal::features_covariance(o.edges_ideal_px, o.edges_covariance_px2, rcm, of_rcm);
  if (!rcm) {
    covariance.row(1).setConstant(std::numeric_limits<double>::quiet_NaN());
    covariance.col(1).setConstant(std::numeric_limits<double>::quiet_NaN());
  }
  return covariance;
}

std::string summary(const Observed& seen) {
  const Observation& o = seen.observation;
  std::string text = o.instrument + ": " + std::string(to_string(o.status));
  if (!is_ok(seen)) return text;
  text += fmt::format(", tau {:.4f} rad (sigma {:.1f} mrad)", o.tau_rad, 1e3 * o.sigma_tau_rad);
  if (!o.rcm) return text;
  const JointVector& q = o.rcm->q;
  return text + fmt::format(", q = [{:.4f} rad, {:.4f} rad, {:.5f} m, {:.4f} rad]", q.theta_rad, q.phi_rad, q.rho_m,
                            q.psi_rad);
}

Image overlay(const Observed& seen, const Picture<"image">& image) {
  Rig rig{seen.rig->camera, {}, {}};
  if (const auto index = internal::instrument_index(*seen.rig, seen.observation.instrument))
    rig.instruments.push_back(seen.rig->instruments[*index]);
  return array_of(unlocked([&] { return draw_overlay(image.bgr, rig, {seen.observation}); }));
}

py::tuple state_of_observed(const Observed& seen) {
  return py::make_tuple(state_of(*seen.rig), state_of(seen.observation), seen.stamp_s);
}

Observed observed_from(const py::tuple& state) {
  const auto rig = std::make_shared<Rig>();
  set_state(state[0], *rig);
  Observed seen{{}, rig, state[2].cast<std::optional<double>>()};
  set_state(state[1], seen.observation);
  return seen;
}

void bind_observation(py::module_& m) {
  std::vector<std::string> words;
  for (int i = 0; i <= static_cast<int>(Status::blended); ++i) words.emplace_back(to_string(static_cast<Status>(i)));
  m.attr("_statuses") = words;

  using Pose = Observation::MarkerPose;
  py::class_<Pose> pose_type(m, "MarkerPose", R"(The marker's pose, with or without an RCM.

Origin at the marker's proximal end on the axis, z along the axis to the tip, x towards tau = 0.)");
  bind_state(pose_type);
  pose_type
      .def_property_readonly("camera_from_marker",
                             read_only<Pose>([](const Pose& pose) { return matrix_of(pose.camera_from_marker); }),
                             "float[4, 4], metres")
      .def_readonly("sigma_xy_m", &Pose::sigma_xy_m, "of the origin, across the camera's axis")
      .def_readonly("sigma_z_m", &Pose::sigma_z_m, "of its depth")
      .def_readonly("sigma_axis_rad", &Pose::sigma_axis_rad, "of the angle between the axis and the true one")
      .def_readonly("sigma_roll_rad", &Pose::sigma_roll_rad, "about the axis")
      .def_readonly("covariance", &Pose::covariance,
                    "float[6, 6]: of the origin [m] and a rotation vector [rad], in the camera's axes")
      .def("__repr__", [](const Pose& pose) {
        const Eigen::Vector3d& at = pose.camera_from_marker.translation;
        return fmt::format("<lapservo.MarkerPose at {:.5f}, {:.5f}, {:.5f} m>", at.x(), at.y(), at.z());
      });

  using Tip = Observation::Tip;
  py::class_<Tip> tip_type(m, "TipPose", "The pose of the tip behind the marker, by the rig's tool.");
  bind_state(tip_type);
  tip_type
      .def_property_readonly("camera_from_tip",
                             read_only<Tip>([](const Tip& tip) { return matrix_of(tip.camera_from_tip); }),
                             "float[4, 4], metres")
      .def_readonly("covariance", &Tip::covariance,
                    "float[6, 6]: of the position [m] and a rotation vector [rad], in the camera's axes")
      .def_property_readonly("sigma_m", &Tip::sigma_m, "of the distance from the true tip; its parts:")
      .def_readonly("sigma_shaft_m", &Tip::sigma_shaft_m, "by the shaft as it is seen")
      .def_readonly("sigma_place_m", &Tip::sigma_place_m, "by the tool's place in the rig")
      .def_readonly("sigma_readings_m", &Tip::sigma_readings_m, "by the readings of the wrist's joints")
      .def("__repr__", [](const Tip& tip) {
        const Eigen::Vector3d& at = tip.camera_from_tip.translation;
        return fmt::format("<lapservo.TipPose at {:.5f}, {:.5f}, {:.5f} m>", at.x(), at.y(), at.z());
      });

  py::class_<Observed>(m, "Observation", R"(The measurement of one instrument in one frame.

Sigmas are one standard deviation. Of an observation whose status is not ok, every number is None.)")
      .def_property_readonly("status", [](const Observed& seen) { return status_to_python(seen.observation.status); })
      .def_property_readonly("ok", &is_ok, "whether status is Status.ok")
      .def_property_readonly(
          "instrument", [](const Observed& seen) { return seen.observation.instrument; }, "its name in the rig")
      .def_readonly("stamp_s", &Observed::stamp_s, "as given to track()")
      .def_property_readonly("q", when_ok(&q_of),
                             "float[4]: theta, phi [rad], rho [m], psi [rad]; None without camera_from_rcm")
      .def_property_readonly("q_covariance", when_ok(&q_covariance_of), "float[4, 4], of q")
      .def_property_readonly("features", when_ok(&features_of),
                             "float[4]: s [rad], r, l, d [px] (eq. 12 to 15); r is NaN where the RCM is unknown")
      .def_property_readonly(
          "features_covariance", when_ok(&features_covariance_of),
          "float[4, 4], of features, to first order; r's with what the rig's sigmas say of camera_from_rcm and "
          "the camera's matrix; its row and column are NaN where r is")
      .def_property_readonly("cross_ratio",
                             when_ok([](const Observed& seen) { return seen.observation.features.cross_ratio; }))
      .def_property_readonly("tau_rad", when_ok(&Observation::tau_rad),
                             "azimuth of the marker on the centre line, [0, 2 pi)")
      .def_property_readonly("sigma_tau_rad", when_ok(&Observation::sigma_tau_rad))
      .def_property_readonly("p_false", when_ok(&Observation::p_false),
                             "probability that psi and tau are off by more than 0.1 rad; None by method 'centerline'")
      .def_property_readonly("edges_px",
                             when_ok([](const Observed& seen) { return points_of(seen.observation.edges_raw_px); }),
                             "float[4, 2]: e0 to e3 on the centre line, raw pixels")
      .def_property_readonly("edges_ideal_px",
                             when_ok([](const Observed& seen) { return points_of(seen.observation.edges_ideal_px); }),
                             "float[4, 2]: the same, undistorted")
      .def_property_readonly("edges_covariance_px2", when_ok(&Observation::edges_covariance_px2),
                             "float[8, 8], of edges_ideal_px, row by row")
      .def_property_readonly("marker_pose", when_ok(&Observation::marker), "MarkerPose; None by method 'centerline'")
      .def_property_readonly(
          "tip", when_ok(&Observation::tip),
          "TipPose; None where the rig has no tool, or no place of it, or its wrist's readings are not set")
      .def("overlay", &overlay, py::arg("image"),
           "The frame with what was seen drawn in, as a new uint8[H, W, 3]; what was refused in dashes.")
      .def(py::pickle(&state_of_observed, &observed_from))
      .def(
          "__eq__",
          [](const Observed& a, const Observed& b) {
            return *a.rig == *b.rig && a.stamp_s == b.stamp_s && equal(a.observation, b.observation);
          },
          py::is_operator())
      .def("__hash__", &hash_of)
      .def("__repr__", [](const Observed& seen) { return "<lapservo.Observation " + summary(seen) + ">"; });
}

Method method_of(const std::string& word) {
  if (const auto method = method_from_string(word)) return *method;
  throw InputError("Tracker", "method", word, "surface or centerline");
}

// One frame after another, by one thread at a time whoever calls.
class SafeTracker {
 public:
  SafeTracker(std::shared_ptr<const Rig> rig, const TrackerOptions& options)
      : rig_(std::move(rig)), deinterlace_(options.deinterlace || rig_->camera.deinterlace), tracker_(*rig_, options) {}

  std::vector<Observed> track(const Picture<"image">& image, const std::optional<Number<"stamp_s">>& stamp_s) {
    const py::gil_scoped_release others_run;
    const std::lock_guard lock(mutex_);
    const auto at_s = stamp_s ? std::optional(stamp_s->value) : std::nullopt;
    return observed(tracker_.track(image.bgr, at_s), rig_, at_s);
  }
  std::vector<Observed> track_frame(const Frame& frame) {
    internal::check_frame_reading(frame, "frame", rig_->camera.response, deinterlace_);
    const py::gil_scoped_release others_run;
    const std::lock_guard lock(mutex_);
    return observed(frame.flaw ? tracker_.refuse(*frame.flaw) : tracker_.track(frame.bgr, frame.time_s), rig_,
                    frame.time_s);
  }
  void set_wrist(const std::string& instrument, const std::vector<double>& wrist_rad) {
    const auto index = internal::instrument_index(*rig_, instrument);
    if (!index) throw InputError("set_wrist", "instrument", instrument, "an instrument of the rig");
    const py::gil_scoped_release others_run;
    const std::lock_guard lock(mutex_);
    tracker_.set_wrist(*index, wrist_rad);
  }
  void reset() {
    const py::gil_scoped_release others_run;
    const std::lock_guard lock(mutex_);
    tracker_.reset();
  }

 private:
  std::shared_ptr<const Rig> rig_;
  bool deinterlace_;
  std::mutex mutex_;
  Tracker tracker_;
};

void bind_frames(py::module_& m) {
  py::class_<Frame> type(m, "Frame", "An image of a source.");
  bind_state(type);
  type.def_property_readonly(
          "image", [](const Frame& frame) { return array_of(frame.bgr); }, "uint8[H, W, 3]")
      .def_readonly("index", &Frame::index, "from 0")
      .def_readonly("time_s", &Frame::time_s, "since the first frame")
      .def_readonly("file", &Frame::file, "the image's path; empty for videos and cameras")
      .def_property_readonly(
          "flaw", [](const Frame& frame) { return frame.flaw ? status_to_python(*frame.flaw) : py::none(); },
          "Status: why nothing is to be measured in it, or None")
      .def("__repr__",
           [](const Frame& self) { return fmt::format("<lapservo.Frame {} at {:.6f} s>", self.index, self.time_s); });
  py::class_<FrameSource>(m, "FrameSource", "Frames of images, a video or a camera, to be iterated over once.")
      .def_property_readonly("frame_count", &FrameSource::frame_count, "where it is known beforehand")
      .def_property_readonly("frames_per_second", &FrameSource::frames_per_second)
      .def_property_readonly("remark", &FrameSource::remark,
                             "how it is read where the file does not say, and the option that decides, or ''")
      .def_property_readonly(
          "complaint", [](const FrameSource& source) { return unlocked([&] { return source.complaint(); }); },
          "after the end: what is wrong with the file as a whole, or ''")
      .def("__iter__", [](FrameSource& source) -> FrameSource& { return source; })
      .def("__next__", [](FrameSource& source) {
        auto frame = unlocked([&] { return source.next(); });
        if (!frame) throw py::stop_iteration();
        return *frame;
      });
  m.def(
      "open_frames",
      [](const std::filesystem::path& input, double fps, bool deinterlaced, const std::string& colour_matrix,
         const std::string& chroma_location, const std::string& image_topic) {
        return unlocked([&] {
          return open_path(input.string(), fps, {deinterlaced, colour_matrix, chroma_location}, image_topic);
        });
      },
      py::arg("input"), py::arg("fps") = 30.0, py::arg("deinterlaced") = false, py::arg("colour_matrix") = "",
      py::arg("chroma_location") = "", py::arg("image_topic") = "",
      "An image, a folder of images (with `fps`), a video, a bag of ROS 1 or 2, 'rtsp://...', '/dev/video0' or "
      "'gst:PIPELINE': a FrameSource. `deinterlaced`: one field of each frame is "
      "tracked, as the rig's camera or the tracker has deinterlace. `colour_matrix` ('bt601', "
      "'bt709', 'bt2020') and `chroma_location` ('left', 'centre', 'top-left') of a video, in place of its tags; "
      "`image_topic`: in a bag with several.");
  m.def(
      "_picture", [](const Picture<"image">& image) { return image.kept; }, py::arg("image"));
  m.def(
      "_png",
      [](const Picture<"image">& image) {
        const auto bytes = internal::encode_png(image.bgr);
        return py::bytes(reinterpret_cast<const char*>(bytes.data()), bytes.size());
      },
      py::arg("image"));
  m.def(
      "read_image", [](const std::filesystem::path& path) { return array_of(read_image(path)); }, py::arg("path"),
      "uint8[H, W, 3] of an image file; InputError for a damaged file, a palette or an orientation.");
}

}  // namespace

std::vector<Observed> observed(const std::vector<Observation>& observations, const std::shared_ptr<const Rig>& rig,
                               std::optional<double> stamp_s) {
  std::vector<Observed> seen;
  seen.reserve(observations.size());
  for (const Observation& observation : observations) seen.push_back({observation, rig, stamp_s});
  return seen;
}

void bind_tracker(py::module_& m) {
  bind_observation(m);
  bind_frames(m);
  py::class_<SafeTracker>(m, "Tracker", R"(Finds all instruments of a rig in the frames of one camera.

Holds what it learnt from the frame before. Threads may share it; frames are then tracked one after another.)")
      .def(py::init([](std::shared_ptr<Rig> rig, const std::string& method, bool single, bool deinterlace,
                       std::optional<double> frame_budget, double max_p_false) {
             return std::make_unique<SafeTracker>(
                 std::move(rig), TrackerOptions{method_of(method), single, deinterlace, frame_budget, max_p_false});
           }),
           py::arg("rig"), py::kw_only(), py::arg("method") = "surface", py::arg("single") = false,
           py::arg("deinterlace") = false, py::arg("frame_budget") = TrackerOptions().frame_budget,
           py::arg("max_p_false") = TrackerOptions().max_p_false,
           "method: 'surface', or the paper's 'centerline'; single: every frame on its own, searched whole; "
           "deinterlace: track the field of the even rows; frame_budget: what a frame may cost, in counted units of "
           "about half a microsecond (a longer search goes on in the next frame), or None: as much as it takes, which "
           "images that don't follow one another need; max_p_false: an instrument is uncertain where a "
           "print that differs from the rig makes psi wrong with a higher probability.")
      .def("track", &SafeTracker::track_frame, py::arg("frame"),
           "The same of a Frame; one that is flawed is refused, with its flaw for a status. InputError where the frame "
           "was read otherwise than this rig and tracker have it: with deinterlaced or without, or light as sRGB.")
      .def("track", &SafeTracker::track, py::arg("image"), py::arg("stamp_s") = py::none(),
           R"(list[Observation], one per instrument, of uint8[H, W, 3] in blue green red, of the rig's size.

The image is not copied; other Python threads run meanwhile.)")
      .def(
          "set_wrist", &SafeTracker::set_wrist, py::arg("instrument"), py::arg("wrist_rad"),
          "Readings [rad] of an instrument's wrist_joints in the frames to come; an empty list where they are unknown.")
      .def("reset", &SafeTracker::reset, "Forgets the frame before: the next one is searched anew.");
}

}  // namespace lapservo::python
