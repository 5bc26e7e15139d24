#include <filesystem>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "lapservo/calibration/camera/camera_measurement.h"
#include "lapservo/calibration/colour/colour_calibration.h"
#include "lapservo/calibration/marker/marker_measurement.h"
#include "lapservo/calibration/registration/registration_measurement.h"
#include "lapservo/core/atomic_file.h"
#include "lapservo/core/error.h"
#include "lapservo/rig/instruments.h"
#include "lapservo/rig/rig_writer.h"
#include "python/src/bindings.h"
#include "python/src/conversions.h"
#include "python/src/python_frames.h"

// The data from which python/lapservo/_calibration.py makes its results.
namespace lapservo::python {
namespace {
using namespace internal;
namespace fs = std::filesystem;
using namespace py::literals;

// A rig that Python has, or that stands in a file.
struct GivenRig {
  Rig rig;
  fs::path path;

  std::string name() const { return path.empty() ? "Rig" : path.string(); }
};

GivenRig rig_of(const py::object& given) {
  if (py::isinstance<Rig>(given)) return {given.cast<Rig>(), {}};
  const auto path = given.cast<fs::path>();
  return {load_rig(path), path};
}

// Ctrl-C ends it as an exception of Python's.
JobWatch watch_of(const py::object& progress) {
  JobWatch watch;
  watch.is_stopped = is_interrupted;
  if (!progress.is_none())
    watch.progress = [&progress](std::optional<int> total, int done, const std::string& remark) {
      const py::gil_scoped_acquire mine;
      progress(done, total, remark);
    };
  return watch;
}

void expect_result(const std::string& refusal, const std::string& source) {
  if (!refusal.empty()) throw InputError(source, refusal);
}

// The fields of every result and its own: without a rig, `camera` is the measured one.
template <typename Calibration, typename... Own>
py::dict result_of(const std::optional<GivenRig>& measured, const Camera& camera,
                   const std::vector<CalibratedNumber>& numbers, const std::string& complaint,
                   const Calibration& calibration, Own&&... own) {
  py::list rows;
  for (const CalibratedNumber& n : numbers) rows.append(py::make_tuple(n.name, n.before, n.after, n.sigma));
  return py::dict("yaml"_a = measured ? measured_rig_yaml(measured->rig, measured->path) : camera_yaml(camera),
                  "numbers"_a = rows, "complaint"_a = complaint, "faults"_a = calibration.faults,
                  "rig"_a = measured ? std::optional(with_absolute_files(measured->rig)) : std::nullopt,
                  std::forward<Own>(own)...);
}

py::dict calibrate_camera(const py::list& pictures, const std::string& corners, double square_m, const py::object& rig,
                          const std::string& dictionary, std::optional<double> marker_m, std::size_t most_views,
                          const py::object& progress) {
  const BoardWords::Names names{"board", "marker_m", "dictionary"};
  if (!(square_m >= 1e-4 && square_m <= 1))
    throw InputError("square_m", "width", fmt::format("{}", square_m), "0.0001 to 1 m");
  if (most_views < 4 || most_views > 200)
    throw InputError("views", "number", fmt::format("{}", most_views), "4 to 200");
  if (pictures.empty()) throw InputError("frames", "is empty, expected images, folders or videos of the board");
  const Board board = board_of({corners, square_m, dictionary, marker_m}, names);
  std::optional<GivenRig> given;
  if (!rig.is_none()) given = rig_of(rig);
  const Camera before = given ? given->rig.camera : Camera{};
  const JobWatch watch = watch_of(progress);
  BoardRecordings recordings(board, most_views, given ? std::optional(given->rig) : std::nullopt);
  const bool several = pictures.size() > 1;
  std::string name, complaint;
  for (const py::handle each : pictures) {
    constexpr double fps = 30;
    const GivenFrames frames(py::reinterpret_borrow<py::object>(each), fps, given ? &given->rig.camera : nullptr, false,
                             false);
    name = name.empty() || name == frames.name ? frames.name : frames.name + " and others";
    const py::gil_scoped_release others_run;
    recordings.look_at(*frames.source, frames.name, watch);
    if (const std::string& latest = recordings.read().complaint; !latest.empty())
      complaint.append(complaint.empty() ? "" : "; ").append(several ? frames.name + ": " : "").append(latest);
  }
  const std::vector<std::string> without_board = recordings.without_board();
  const CameraCalibration calibration =
      unlocked([&] { return measure_camera(board, std::move(recordings), before, watch); });
  expect_result(calibration.refusal, name);
  const Camera camera = measured_camera(calibration);
  if (given) given->rig.camera = camera, given->rig.camera_file.clear();
  py::list views;
  for (std::size_t i = 0; i < calibration.views.size(); ++i)
    views.append(
        py::make_tuple(calibration.views[i].name, calibration.views[i].corners.size(), calibration.view_rms_px[i]));
  const auto& response = calibration.response;
  return result_of(given, camera, calibrated_numbers(before, calibration), complaint, calibration, "camera"_a = camera,
                   "rms_px"_a = calibration.rms_px, "noise"_a = calibration.noise, "views"_a = views,
                   "without_board"_a = without_board, "advice"_a = calibration.advice,
                   "sigma_response"_a = response ? std::optional(response->sigma) : std::nullopt,
                   "sharpening"_a = response ? response->sharpening : 0.0);
}

py::dict calibrate_colour(const py::object& frames, const py::object& rig, const std::optional<std::string>& instrument,
                          bool replace_response, bool deinterlace, double fps, const py::object& progress) {
  const GivenRig given = rig_of(rig);
  const std::size_t index = named_instrument(given.rig, instrument, given.name(), "instrument");
  const GivenFrames source(frames, fps, &given.rig.camera, deinterlace);
  const JobWatch watch = watch_of(progress);
  const ColourCalibration calibration = unlocked([&] {
    return measure_colour(given.rig, index, {*source.source, source.name, deinterlace}, replace_response, watch);
  });
  expect_result(calibration.refusal, source.name);
  const Instrument& before = given.rig.instruments[index];
  return result_of(GivenRig{with_colour(given.rig, index, calibration), given.path}, {},
                   calibrated_numbers(before.marker, calibration), calibration.read.complaint, calibration,
                   "instrument"_a = before.name, "hues_deg"_a = calibration.hues_deg,
                   "sigma_hues_deg"_a = calibration.sigma_hues_deg, "response"_a = calibration.response_found,
                   "found_before"_a = calibration.found_before, "found"_a = calibration.found,
                   "frames"_a = calibration.frames);
}

// A CSV's path, or columns by name: through the same table, by as many digits as reads back to the last bit.
std::optional<JointInput> joints_of(const py::object& given, const Instrument& instrument, const std::string& rig) {
  if (given.is_none()) return std::nullopt;
  std::string source = "joints";
  CsvTable table = [&] {
    if (!py::isinstance<py::dict>(given)) {
      const auto path = given.cast<fs::path>();
      return source = path.string(), CsvTable::read(path);
    }
    std::vector<std::pair<std::string, std::vector<double>>> columns;
    for (const auto& [name, values] : given.cast<py::dict>())
      columns.emplace_back(name.cast<std::string>(), values.cast<std::vector<double>>());
    std::string text;
    for (const auto& [name, values] : columns) text += (text.empty() ? "" : ",") + csv_field(name);
    text += "\n";
    for (std::size_t row = 0; !columns.empty() && row < columns.front().second.size(); ++row)
      for (std::size_t i = 0; i < columns.size(); ++i) {
        if (columns[i].second.size() != columns.front().second.size())
          throw InputError(source, columns[i].first, fmt::format("of {} rows", columns[i].second.size()),
                           fmt::format("{}, as {} has", columns.front().second.size(), columns.front().first));
        text += fmt::format("{}{}", columns[i].second[row], i + 1 == columns.size() ? "\n" : ",");
      }
    return CsvTable::parse(text, source);
  }();
  std::vector<std::string> names = table.columns();
  std::erase(names, "time_s");
  const Joints joints = internal::joints_of(instrument, names, source, rig);
  return JointInput{joints, joint_recording_of(table, source, joints), source};
}

py::dict calibrate_marker(const py::object& frames, const py::object& rig, const py::object& joints,
                          const std::optional<std::string>& instrument, bool deinterlace, double fps,
                          const py::object& progress) {
  const GivenRig given = rig_of(rig);
  const std::size_t index = named_instrument(given.rig, instrument, given.name(), "instrument");
  const Instrument& before = given.rig.instruments[index];
  if (!joints.is_none()) expect_registration(before, given.name(), "joints");
  const std::optional<JointInput> turn = joints_of(joints, before, given.name());
  const GivenFrames source(frames, fps, &given.rig.camera, deinterlace);
  const JobWatch watch = watch_of(progress);
  const MarkerCalibration calibration = unlocked([&] {
    return measure_marker(given.rig, index, {*source.source, source.name, deinterlace}, turn, watch);
  });
  expect_result(calibration.refusal, source.name);
  GivenRig after = given;
  after.rig.instruments[index].marker = calibration.marker;
  return result_of(after, {}, calibrated_numbers(before.marker, calibration.marker, turn.has_value()),
                   calibration.read.complaint, calibration, "instrument"_a = before.name,
                   "looked_at"_a = calibration.read.looked_at, "found"_a = calibration.found,
                   "frames"_a = calibration.frames, "seam_views"_a = calibration.seam_views,
                   "before_px"_a = calibration.before_px, "after_px"_a = calibration.after_px,
                   "seam_may_lag"_a = calibration.seam_may_lag);
}

Eigen::Matrix<double, Eigen::Dynamic, 4> residuals_of(const Registration& registration) {
  Eigen::Matrix<double, Eigen::Dynamic, 4> rows(static_cast<Eigen::Index>(registration.residuals.size()), 4);
  for (std::size_t i = 0; i < registration.residuals.size(); ++i) {
    const RegistrationResidual& r = registration.residuals[i];
    rows.row(static_cast<Eigen::Index>(i)) << r.time_s, r.position_m, r.axis_rad, r.roll_rad;
  }
  return rows;
}

py::dict calibrate_registration(const py::object& frames, const py::object& rig, const py::object& joints,
                                const std::optional<std::string>& instrument_name, bool deinterlace, double fps,
                                const py::object& progress) {
  const GivenRig given = rig_of(rig);
  const std::size_t index = named_instrument(given.rig, instrument_name, given.name(), "instrument");
  Instrument instrument = given.rig.instruments[index];
  const bool table = is_path(frames) && frames.cast<fs::path>().extension() == ".csv";
  std::optional<GivenFrames> source;
  if (!table) source.emplace(frames, fps, &given.rig.camera, deinterlace);
  const std::string name = table ? frames.cast<fs::path>().string() : source->name;
  const auto read = joints_of(joints, instrument, given.name());
  if (read) instrument.joints = read->joints;
  MeasuredPoses poses;
  Registration registration;
  const JobWatch watch = watch_of(progress);
  {
    const py::gil_scoped_release others_run;
    poses = table ? poses_in_table(name, instrument.name)
                  : poses_in_frames(given.rig, index, {*source->source, name, deinterlace}, watch);
    expect_result(poses.none, name);
    registration = read ? register_arm(instrument, poses.all, read->recording, read->source, watch.is_stopped)
                        : register_rcm(instrument, poses.all, watch.is_stopped);
  }
  expect_result(registration.refusal, name);
  GivenRig after = given;
  after.rig.instruments[index] = registered(given.rig.instruments[index], registration);
  const auto of_arm = [&](auto member) {
    return registration.arm ? std::optional(*registration.arm.*member) : std::nullopt;
  };
  using Arm = Registration::Arm;
  return result_of(after, {}, registered_numbers(instrument, registration), poses.read.complaint, registration,
                   "instrument"_a = instrument.name, "camera_from_rcm"_a = matrix_of(registration.camera_from_rcm),
                   "sigma_translation_m"_a = registration.sigma_translation_m,
                   "sigma_quaternion_xyzw"_a = registration.sigma_quaternion,
                   "sigma_rotation_rad"_a =
                       registration.sigma_quaternion ? std::optional(registration.sigma_rotation_rad) : std::nullopt,
                   "sigma_offset"_a = of_arm(&Arm::sigma_offset), "image_delay_s"_a = of_arm(&Arm::image_delay_s),
                   "sigma_image_delay_s"_a = of_arm(&Arm::sigma_image_delay_s), "backlash"_a = of_arm(&Arm::backlash),
                   "residuals"_a = residuals_of(registration), "unknown"_a = registration.unknown);
}

}  // namespace

void bind_calibration(py::module_& m) {
  m.def("_calibrate_camera", &calibrate_camera);
  m.def("_calibrate_colour", &calibrate_colour);
  m.def("_calibrate_marker", &calibrate_marker);
  m.def("_calibrate_registration", &calibrate_registration);
  m.def("_write_calibrated", [](const std::optional<Rig>& rig, const std::string& yaml, const fs::path& path) {
    rig ? refuse_rig_over_part(path) : refuse_part_over_rig(path, "camera");
    write_file(path, rig ? measured_rig_yaml(*rig, path) : yaml);
  });
}

}  // namespace lapservo::python
