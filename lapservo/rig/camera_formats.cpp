#include "lapservo/rig/camera_formats.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <initializer_list>
#include <optional>
#include <string_view>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "lapservo/core/error.h"
#include "lapservo/core/yaml_field.h"

namespace lapservo::internal {
namespace {

constexpr auto file_kind = "camera file";
constexpr std::string_view opencv_header = "%YAML:1.0";

// Those that OpenCV's programs of calibration, today's and earlier ones, write beside a camera.
constexpr std::initializer_list<const char*> opencv_keys{"calibration_time",
                                                         "nframes",
                                                         "nr_of_frames",
                                                         "board_width",
                                                         "board_height",
                                                         "square_size",
                                                         "marker_size",
                                                         "aspectRatio",
                                                         "fix_aspect_ratio",
                                                         "flags",
                                                         "avg_reprojection_error",
                                                         "per_view_reprojection_errors",
                                                         "extrinsic_parameters",
                                                         "image_points",
                                                         "grid_points",
                                                         "calibration_Time",
                                                         "nrOfFrames",
                                                         "board_Width",
                                                         "board_Height",
                                                         "square_Size",
                                                         "FixAspectRatio",
                                                         "flagValue",
                                                         "Avg_Reprojection_Error",
                                                         "Per_View_Reprojection_Errors",
                                                         "Extrinsic_Parameters",
                                                         "Image_points"};

// The texts of a rig's keys.
struct CameraTexts {
  std::string width, height, model;  // without a model: plumb_bob
  std::vector<std::string> matrix, distortion;
  std::string others;  // lines of keys that are not the format's
};

// The fields of a file, those that were read, and the names of missing ones.
class Fields {
 public:
  Fields(YamlField map, std::string source, std::string format)
      : map_(std::move(map)), source_(std::move(source)), format_(std::move(format)) {}

  // The first of these keys that is there.
  std::optional<YamlField> find(std::initializer_list<const char*> keys) {
    for (const char* key : keys)
      if (const YamlField field = map_[key]; field.present()) {
        read_.emplace_back(key);
        return field;
      }
    return std::nullopt;
  }
  // The lines of all keys but those read and `unused`, which the format has beside them.
  std::string others(std::initializer_list<const char*> unused) const {
    std::string lines;
    for (const auto& [key, value] : map_.entries("a map"))
      if (std::find(unused.begin(), unused.end(), key) == unused.end() &&
          std::find(read_.begin(), read_.end(), key) == read_.end())
        lines += value.yaml_of(key);
    return lines;
  }
  std::string text(std::initializer_list<const char*> keys) {
    const auto field = find(keys);
    if (!field) missing_.emplace_back(*keys.begin());
    return field ? field->text("a number") : "";
  }
  // Numbers of a list, or of an OpenCV matrix's data.
  std::vector<std::string> texts(std::initializer_list<const char*> keys) {
    auto field = find(keys);
    if (field && field->is_map()) field = (*field)["data"];
    std::vector<std::string> all;
    if (!field || !field->present()) {
      missing_.emplace_back(*keys.begin());
    } else {
      for (const YamlField& item : field->list("numbers")) all.push_back(item.text("a number"));
    }
    return all;
  }
  void refuse_missing() const {
    if (!missing_.empty())
      throw InputError(source_, fmt::format("is {} without {}: add what is missing, or let lapservo calibrate camera "
                                            "write a file",
                                            format_, fmt::join(missing_, ", ")));
  }
  [[noreturn]] void refuse(const std::string& why) const {
    throw InputError(source_,
                     fmt::format("is {} {}: lapservo calibrate camera measures a plumb_bob camera", format_, why));
  }

 private:
  YamlField map_;
  std::string source_, format_;
  std::vector<std::string> read_, missing_;
};

bool is_zero(const std::string& number) {
  return number.find_first_not_of("+-0.") == std::string::npos;
}

CameraTexts read_opencv(Fields fields) {
  if (const auto fisheye = fields.find({"fisheye_model"}); fisheye && !is_zero(fisheye->text("0 or 1")))
    fields.refuse("of a fisheye lens");
  CameraTexts camera;
  camera.width = fields.text({"image_width", "image_Width"});
  camera.height = fields.text({"image_height", "image_Height"});
  camera.matrix = fields.texts({"camera_matrix", "Camera_Matrix", "cameraMatrix", "K"});
  camera.distortion = fields.texts({"distortion_coefficients", "Distortion_Coefficients", "distCoeffs", "D"});
  fields.refuse_missing();
  camera.others = fields.others(opencv_keys);
  return camera;
}

CameraTexts read_camera_info(Fields fields) {
  CameraTexts camera;
  camera.width = fields.text({"width"});
  camera.height = fields.text({"height"});
  camera.matrix = fields.texts({"K", "k"});
  camera.distortion = fields.texts({"D", "d"});
  fields.refuse_missing();
  if (std::all_of(camera.matrix.begin(), camera.matrix.end(), is_zero))
    fields.refuse("of a camera that is not calibrated (K is zero)");
  if (const auto model = fields.find({"distortion_model"}); model && model->value_text() != "''")
    camera.model = model->text("a distortion model");
  camera.others = fields.others({"R", "P", "r", "p"});
  return camera;
}

CameraTexts read_kalibr(Fields fields) {
  const auto model = fields.find({"camera_model"}), distortion = fields.find({"distortion_model"});
  if (model && model->value_text() != "pinhole") fields.refuse("of the camera model " + model->value_text());
  const std::string lens = distortion ? distortion->value_text() : "none";
  if (lens != "radtan" && lens != "none") fields.refuse("of the distortion model " + lens);
  CameraTexts camera;
  const auto size = fields.texts({"resolution"});
  const auto k = fields.texts({"intrinsics"});
  if (lens == "radtan") camera.distortion = fields.texts({"distortion_coeffs"});
  fields.refuse_missing();
  if (size.size() != 2 || k.size() != 4) fields.refuse("without two numbers of resolution and four of intrinsics");
  camera.width = size[0], camera.height = size[1];
  camera.matrix = {k[0], "0", k[2], "0", k[1], k[3], "0", "0", "1"};
  camera.others = fields.others({"cam_overlaps", "rostopic", "T_cam_imu", "timeshift_cam_imu", "T_cn_cnm1"});
  return camera;
}

std::string yaml_of(const CameraTexts& camera) {
  const auto& d = camera.distortion;
  return fmt::format(
      "image_width: {}\nimage_height: {}\ncamera_matrix: {{rows: 3, cols: 3, data: [{}]}}\n"
      "distortion_coefficients: {{rows: 1, cols: {}, data: [{}]}}\n{}{}",
      camera.width, camera.height, fmt::join(camera.matrix, ", "), d.size(), fmt::join(d, ", "),
      camera.model.empty() ? "" : "distortion_model: " + camera.model + "\n", camera.others);
}

// Without OpenCV's header, which YAML has as "%YAML 1.0", and without the documents after the first, as of
// `rostopic echo`.
std::string first_document(std::string text) {
  if (text.starts_with(opencv_header)) text.erase(0, text.find('\n'));
  const std::size_t begin = text.find_first_not_of(" \n\r-");
  const std::size_t end = begin == std::string::npos ? begin : text.find("\n---", begin);
  return text.substr(0, end);
}

}  // namespace

std::string with_rig_keys(const std::string& text, const std::string& source) {
  const bool opencv = text.starts_with(opencv_header) || text.find("!!opencv-matrix") != std::string::npos;
  const YamlField root = YamlField::parse(first_document(text), source, file_kind);
  if (!root.is_map()) return text;
  if (opencv) return yaml_of(read_opencv({root, source, "an OpenCV calibration"}));
  if (root["K"].present() || root["k"].present())
    return yaml_of(read_camera_info({root, source, "a CameraInfo message"}));
  if (root["cam1"].present())
    throw InputError(source, "is a Kalibr camchain of several cameras, expected one: keep the rig's as cam0");
  if (root["cam0"].present())
    return yaml_of(read_kalibr({root["cam0"], source, "a Kalibr camchain"})) +
           Fields(root, source, "").others({"cam0"});
  return text;
}

// Drivers leave k3 out, or all where there is no distortion, and write it as rational_polynomial with k4 k5 k6 of 0.
const char* expected_distortion(std::span<const double> coefficients) {
  constexpr std::array<std::size_t, 6> sizes{0, 4, 5, 8, 12, 14};
  if (std::find(sizes.begin(), sizes.end(), coefficients.size()) == sizes.end())
    return "k1 k2 p1 p2 k3, of which k3 or all may be left out, or k4 k5 k6 of 0 follow";
  const auto others = coefficients.subspan(std::min<std::size_t>(5, coefficients.size()));
  if (std::any_of(others.begin(), others.end(), [](double k) { return k != 0; }))
    return "k4 k5 k6 of 0: a rational lens is not modelled (lapservo calibrate camera fits plumb_bob)";
  return nullptr;
}

}  // namespace lapservo::internal
