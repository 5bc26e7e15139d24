#include "lapservo/servo/servo_log.h"

#include <array>
#include <cerrno>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <string>
#include <utility>

#include <fmt/format.h>

#include "lapservo/core/csv.h"
#include "lapservo/core/error.h"
#include "lapservo/servo/servo.h"

namespace lapservo::internal {
namespace {

using Names = std::array<std::string_view, 4>;
constexpr auto features = FeatureVector::names;
constexpr Names rates{"s_rad_s", "r_px_s", "l_px_s", "d_px_s"};
constexpr Names accelerations{"s_rad_s2", "r_px_s2", "l_px_s2", "d_px_s2"};
constexpr auto joints = JointVector::names;
constexpr Names joint_rates{"theta_rad_s", "phi_rad_s", "rho_m_s", "psi_rad_s"};
constexpr std::array<std::string_view, 3> positions{"x_m", "y_m", "z_m"};
constexpr Names rotations{"qx", "qy", "qz", "qw"};
constexpr Names ends{"e0_u_px", "e0_v_px", "e3_u_px", "e3_v_px"};

template <std::size_t N>
void name(std::vector<std::string>& columns, const char* prefix, const std::array<std::string_view, N>& names) {
  for (const std::string_view each : names) columns.push_back(prefix + std::string(each));
}

// The shortest text that reads back as the same number.
void write(std::vector<std::string>& fields, double number) {
  fields.push_back(fmt::format("{}", number));
}
void write(std::vector<std::string>& fields, const Eigen::Vector4d& numbers) {
  for (const double number : numbers) write(fields, number);
}
void leave_empty(std::vector<std::string>& fields, int count) {
  fields.resize(fields.size() + static_cast<std::size_t>(count));
}

std::string covariance_column(int row, int column) {
  return fmt::format("seen_cov_{}{}", row, column);
}

std::vector<std::string> input_columns() {
  std::vector<std::string> columns{"time_s", "arm_state", "arm_blocked", "arm_follows", "arm_started", "joint_time_s"};
  name(columns, "joint_", joints);
  columns.emplace_back("readings");
  columns.insert(columns.end(), {"image", "image_time_s", "image_registration", "image_repetition"});
  name(columns, "seen_", features);
  for (int i = 0; i < 4; ++i)
    for (int j = i; j < 4; ++j) columns.push_back(covariance_column(i, j));
  name(columns, "seen_", ends);
  name(columns, "seen_", joints);
  name(columns, "seen_marker_", positions);
  name(columns, "seen_marker_", rotations);
  name(columns, "desired_", features);
  name(columns, "desired_", rates);
  name(columns, "desired_", accelerations);
  return columns;
}

std::vector<std::string> make_decision_columns() {
  std::vector<std::string> columns{"action", "reason", "send", "limited", "delay_s", "registration"};
  name(columns, "camera_from_rcm_", positions);
  name(columns, "camera_from_rcm_", rotations);
  name(columns, "velocity_", joint_rates);
  name(columns, "setpoint_", joints);
  name(columns, "setpoint_", joint_rates);
  name(columns, "estimated_", features);
  name(columns, "estimated_", joints);
  name(columns, "error_", features);
  return columns;
}

void write(std::vector<std::string>& fields, const Rigid3& pose) {
  for (const double number : pose.translation) write(fields, number);
  write(fields, Eigen::Vector4d(pose.rotation.coeffs()));
}

void write_image(std::vector<std::string>& fields, const std::optional<ImageMeasurement>& image) {
  constexpr int numbers = 4 + 10 + 4 + 4, of_marker = 7;
  fields.emplace_back(!image ? "none" : image->found ? "found" : image->camera_from_marker ? "marker" : "lost");
  if (!image) return leave_empty(fields, 3 + numbers + of_marker);
  write(fields, image->time_s);
  fields.push_back(fmt::format("{}", image->registration));
  fields.emplace_back(to_string(image->repetition));
  if (!image->found && !image->camera_from_marker) return leave_empty(fields, numbers + of_marker);
  write(fields, image->features);
  for (int i = 0; i < 4; ++i)
    for (int j = i; j < 4; ++j) write(fields, image->covariance(i, j));
  write(fields, image->ends_px);
  image->q ? write(fields, *image->q) : leave_empty(fields, 4);
  if (!image->camera_from_marker) return leave_empty(fields, of_marker);
  write(fields, *image->camera_from_marker);
}

// time_s theta_rad phi_rad rho_m psi_rad; time_s ...
std::string text_of(const std::vector<JointReading>& readings) {
  std::string text;
  for (const auto& [time_s, q] : readings)
    text +=
        fmt::format("{}{} {} {} {} {}", text.empty() ? "" : ";", time_s, q.theta_rad, q.phi_rad, q.rho_m, q.psi_rad);
  return text;
}

std::vector<std::string> input_fields(const ServoInput& input) {
  std::vector<std::string> fields;
  write(fields, input.time_s);
  fields.emplace_back(to_string(input.joints.operating_state));
  fields.emplace_back(to_string(input.joints.blocked));
  fields.emplace_back(input.joints.follows ? "1" : "0");
  fields.emplace_back(input.joints.started ? "1" : "0");
  write(fields, input.joints.time_s);
  write(fields, input.joints.q.vector());
  fields.push_back(text_of(input.readings));
  write_image(fields, input.image);
  write(fields, input.desired.features);
  write(fields, input.desired.rate);
  write(fields, input.desired.acceleration);
  return fields;
}

// Fields of one row by name, non-finite numbers included: they are what the loop has to cope with.
class Row {
 public:
  Row(const CsvTable& table, std::size_t row, std::string source)
      : table_(table), row_(row), source_(std::move(source)) {}

  const std::string& text(const std::string& column) const { return table_.text(row_, column); }
  double number(const std::string& column) const {
    const std::string& field = text(column);
    char* end = nullptr;
    const double value = std::strtod(field.c_str(), &end);
    if (field.empty() || *end) complain(column, "a number");
    return value;
  }
  bool flag(const std::string& column) const {
    const std::string& field = text(column);
    if (field != "0" && field != "1") complain(column, "0 or 1");
    return field == "1";
  }
  Eigen::Vector4d numbers(const char* prefix, const Names& names) const {
    Eigen::Vector4d values;
    for (int i = 0; i < 4; ++i) values[i] = number(prefix + std::string(names[static_cast<std::size_t>(i)]));
    return values;
  }
  [[noreturn]] void complain(const std::string& column, const char* expected) const {
    throw InputError(source_, fmt::format("tick {}, {}", row_, column), text(column), expected);
  }

 private:
  const CsvTable& table_;
  std::size_t row_;
  std::string source_;
};

std::vector<JointReading> read_readings(const Row& row) {
  constexpr auto column = "readings", expected = "five numbers a reading, readings parted by ;";
  const std::string& text = row.text(column);
  std::vector<JointReading> readings;
  for (const char* at = text.c_str(); *at;) {
    std::array<double, 5> numbers{};
    for (double& number : numbers) {
      char* end = nullptr;
      number = std::strtod(at, &end);
      if (end == at) row.complain(column, expected);
      at = end;
    }
    readings.push_back({numbers[0], {numbers[1], numbers[2], numbers[3], numbers[4]}});
    if (*at && *at != ';') row.complain(column, expected);
    if (*at) ++at;
  }
  return readings;
}

std::optional<ImageMeasurement> read_image(const Row& row) {
  const std::string& word = row.text("image");
  if (word == "none") return std::nullopt;
  if (word != "found" && word != "lost" && word != "marker") row.complain("image", "none, lost, marker or found");
  ImageMeasurement image;
  image.found = word == "found";
  image.time_s = row.number("image_time_s");
  const double registration = row.number("image_registration");
  if (!(std::abs(registration) <= std::numeric_limits<int>::max()) || registration != std::trunc(registration))
    row.complain("image_registration", "a whole number");
  image.registration = static_cast<int>(registration);
  const auto repetition = repetition_from_string(row.text("image_repetition"));
  if (!repetition) row.complain("image_repetition", "none, possible_at_rest or of_a_noisy_camera");
  image.repetition = *repetition;
  if (word == "lost") return image;
  image.features = row.numbers("seen_", features);
  for (int i = 0; i < 4; ++i)
    for (int j = i; j < 4; ++j) image.covariance(i, j) = image.covariance(j, i) = row.number(covariance_column(i, j));
  image.ends_px = row.numbers("seen_", ends);
  if (!row.text("seen_theta_rad").empty()) image.q = row.numbers("seen_", joints);
  if (row.text("seen_marker_x_m").empty()) return image;
  Rigid3& seen = image.camera_from_marker.emplace();
  for (int i = 0; i < 3; ++i)
    seen.translation[i] = row.number("seen_marker_" + std::string(positions[static_cast<std::size_t>(i)]));
  seen.rotation.coeffs() = row.numbers("seen_marker_", rotations);
  return image;
}

ServoInput read_input(const Row& row) {
  ServoInput input;
  input.time_s = row.number("time_s");
  input.joints.time_s = row.number("joint_time_s");
  input.joints.q = JointVector::from_vector(row.numbers("joint_", joints));
  const auto state = operating_state_from_string(row.text("arm_state"));
  if (!state) row.complain("arm_state", "DISABLED, ENABLED, PAUSED or FAULT");
  input.joints.operating_state = *state;
  const auto blocked = blocked_from_string(row.text("arm_blocked"));
  if (!blocked) row.complain("arm_blocked", "none or why the arm was not moved, see docs/statuses.md");
  input.joints.blocked = *blocked;
  input.joints.follows = row.flag("arm_follows");
  input.joints.started = row.flag("arm_started");
  input.readings = read_readings(row);
  input.image = read_image(row);
  input.desired.features = row.numbers("desired_", features);
  input.desired.rate = row.numbers("desired_", rates);
  input.desired.acceleration = row.numbers("desired_", accelerations);
  return input;
}

std::string joined(const std::vector<std::string>& fields) {
  return fmt::format("{}", fmt::join(fields, ","));
}

std::string header() {
  std::vector<std::string> truth;
  name(truth, "true_", joints);
  name(truth, "true_", features);
  return fmt::format("tick,{},{},{}", joined(input_columns()), joined(decision_columns()), joined(truth));
}

}  // namespace

const std::vector<std::string>& decision_columns() {
  static const std::vector<std::string> columns = make_decision_columns();
  return columns;
}

std::vector<std::string> decision_fields(const ServoDecision& decision) {
  const ControlStep& control = decision.control;
  std::vector<std::string> fields{std::string(to_string(control.action)), std::string(to_string(control.reason)),
                                  decision.send ? "1" : "0", control.limited ? "1" : "0"};
  write(fields, control.delay_s);
  fields.push_back(fmt::format("{}", decision.registration));
  decision.camera_from_rcm ? write(fields, *decision.camera_from_rcm) : leave_empty(fields, 7);
  write(fields, control.velocity);
  write(fields, control.setpoint.position);
  write(fields, control.setpoint.velocity);
  if (control.estimate) {
    write(fields, control.estimate->features);
    write(fields, control.estimate->q);
    write(fields, control.error);
  } else {
    leave_empty(fields, 12);
  }
  return fields;
}

InstrumentTruth truth_at(const FeatureModel& true_model, const JointVector& q) {
  InstrumentTruth truth{q.vector(), {}};
  if (const auto state = true_model ? true_model(truth.q) : std::nullopt) truth.features = state->features;
  return truth;
}

ServoLog::ServoLog(const std::filesystem::path& path)
    : path_(path), file_(path, header()), thread_([this] { write_rows(); }) {}

ServoLog::~ServoLog() {
  rows_.close();
  if (thread_.joinable()) thread_.join();
}

void ServoLog::write_rows() {
  try {
    while (const auto row = rows_.pop()) file_.add(*row);
  } catch (...) {
    failure_ = std::current_exception();
    rows_.cancel();
  }
}

void ServoLog::commit() {
  rows_.close();
  if (thread_.joinable()) thread_.join();
  if (failure_) std::rethrow_exception(failure_);
  file_.commit();
}

void ServoLog::add(const ServoInput& input, const ServoDecision& decision,
                   const std::optional<InstrumentTruth>& truth) {
  std::vector<std::string> fields;
  truth ? write(fields, truth->q) : leave_empty(fields, 4);
  truth && truth->features ? write(fields, *truth->features) : leave_empty(fields, 4);
  std::string row = fmt::format("{},{},{},{}", tick_++, joined(input_fields(input)), joined(decision_fields(decision)),
                                joined(fields));
  if (rows_.try_push(std::move(row))) return;
  if (rows_.closed() && failure_) std::rethrow_exception(failure_);
  throw InputError(path_.string(), fmt::format("the disk is too slow: {} rows wait", most_waiting));
}

std::vector<LoggedTick> read_servo_log(const std::filesystem::path& path) {
  const CsvTable table = CsvTable::read(path);
  if (table.rows() == 0) throw InputError(path.string(), "holds no tick, expected the log of a run");
  std::vector<LoggedTick> ticks;
  for (std::size_t i = 0; i < table.rows(); ++i) {
    LoggedTick tick{read_input(Row(table, i, path.string())), {}};
    for (const std::string& column : decision_columns()) tick.decision.push_back(table.text(i, column));
    ticks.push_back(std::move(tick));
  }
  return ticks;
}

std::optional<ReplayDifference> replay(const std::vector<LoggedTick>& log, const Rig& rig,
                                       const ControllerConfig& controller) {
  Servo servo(controller, rig);
  for (std::size_t i = 0; i < log.size(); ++i) {
    const auto fields = decision_fields(servo.step(log[i].input));
    for (std::size_t k = 0; k < fields.size(); ++k)
      if (fields[k] != log[i].decision[k])
        return ReplayDifference{i, decision_columns()[k], log[i].decision[k], fields[k]};
  }
  return std::nullopt;
}

}  // namespace lapservo::internal
