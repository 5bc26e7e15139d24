#include "lapservo/servo/servo_log.h"

#include <array>
#include <cmath>
#include <cstdlib>
#include <limits>
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

// The shortest text that reads back as the same number.
std::string text_of(double number) {
  return fmt::format("{}", number);
}

// The fields of a row, or the names of its columns.
struct Fields {
  bool names = false;
  std::vector<std::string> all{};

  void add(std::string_view name, std::string_view text) { all.emplace_back(names ? name : text); }
  // Empty where there are none.
  template <std::size_t N>
  void add(std::string_view prefix, const std::array<std::string_view, N>& each, const double* numbers) {
    for (std::size_t i = 0; i < N; ++i)
      all.push_back(names ? fmt::format("{}{}", prefix, each[i]) : numbers ? text_of(numbers[i]) : "");
  }
  void add(std::string_view prefix, const std::optional<Rigid3>& pose) {
    add(prefix, positions, pose ? pose->translation.data() : nullptr);
    add(prefix, rotations, pose ? pose->rotation.coeffs().data() : nullptr);
  }
};

std::string covariance_column(int row, int column) {
  return fmt::format("seen_cov_{}{}", row, column);
}

void add_image(Fields& fields, const std::optional<ImageMeasurement>& image) {
  const ImageMeasurement* seen = image && (image->found || image->camera_from_marker) ? &*image : nullptr;
  fields.add("image", !image ? "none" : !seen ? "lost" : image->found ? "found" : "marker");
  fields.add("image_time_s", image ? text_of(image->time_s) : "");
  fields.add("image_registration", image ? fmt::format("{}", image->registration) : "");
  fields.add("image_repetition", image ? to_string(image->repetition) : "");
  fields.add("seen_", features, seen ? seen->features.data() : nullptr);
  for (int i = 0; i < 4; ++i)
    for (int j = i; j < 4; ++j) fields.add(covariance_column(i, j), seen ? text_of(seen->covariance(i, j)) : "");
  fields.add("seen_", ends, seen ? seen->ends_px.data() : nullptr);
  fields.add("seen_", joints, seen && seen->q ? seen->q->data() : nullptr);
  fields.add("seen_marker_", seen ? seen->camera_from_marker : std::nullopt);
}

// time_s theta_rad phi_rad rho_m psi_rad; time_s ...
std::string text_of(const std::vector<JointReading>& readings) {
  std::string text;
  for (const auto& [time_s, q] : readings)
    text +=
        fmt::format("{}{} {} {} {} {}", text.empty() ? "" : ";", time_s, q.theta_rad, q.phi_rad, q.rho_m, q.psi_rad);
  return text;
}

void add_input(Fields& fields, const ServoInput& input) {
  fields.add("time_s", text_of(input.time_s));
  fields.add("arm_state", to_string(input.joints.operating_state));
  fields.add("arm_blocked", to_string(input.joints.blocked));
  fields.add("arm_follows", input.joints.follows ? "1" : "0");
  fields.add("arm_started", input.joints.started ? "1" : "0");
  fields.add("joint_time_s", text_of(input.joints.time_s));
  fields.add("joint_", joints, input.joints.q.vector().data());
  fields.add("readings", text_of(input.readings));
  add_image(fields, input.image);
  fields.add("desired_", features, input.desired.features.data());
  fields.add("desired_", rates, input.desired.rate.data());
  fields.add("desired_", accelerations, input.desired.acceleration.data());
  fields.add("desired_hold", to_string(input.desired.hold));
}

void add_decision(Fields& fields, const ServoDecision& decision) {
  const ControlStep& control = decision.control;
  const Estimate* estimate = control.estimate ? &*control.estimate : nullptr;
  fields.add("action", to_string(control.action));
  fields.add("reason", to_string(control.reason));
  fields.add("send", decision.send ? "1" : "0");
  fields.add("limited", control.limited ? "1" : "0");
  fields.add("delay_s", control.delay_is_known ? text_of(control.delay_s) : "");
  fields.add("registration", fmt::format("{}", decision.registration));
  fields.add("camera_from_rcm_", decision.camera_from_rcm);
  fields.add("velocity_", joint_rates, control.velocity.data());
  fields.add("setpoint_", joints, control.setpoint.position.data());
  fields.add("setpoint_", joint_rates, control.setpoint.velocity.data());
  fields.add("estimated_", features, estimate ? estimate->features.data() : nullptr);
  fields.add("estimated_", joints, estimate ? estimate->q.data() : nullptr);
  fields.add("error_", features, estimate ? control.error.data() : nullptr);
}

std::string row_of(Fields fields, long tick, const ServoInput& input, const ServoDecision& decision,
                   const std::optional<InstrumentTruth>& truth) {
  fields.add("tick", fmt::format("{}", tick));
  add_input(fields, input);
  add_decision(fields, decision);
  fields.add("true_", joints, truth ? truth->q.data() : nullptr);
  fields.add("true_", features, truth && truth->features ? truth->features->data() : nullptr);
  return fmt::format("{}", fmt::join(fields.all, ","));
}

const std::vector<std::string>& decision_columns() {
  static const std::vector<std::string> columns = [] {
    Fields names{true};
    add_decision(names, {});
    return names.all;
  }();
  return columns;
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
  template <std::size_t N>
  Eigen::Vector<double, N> numbers(const std::string& prefix, const std::array<std::string_view, N>& names) const {
    Eigen::Vector<double, N> values;
    for (std::size_t i = 0; i < N; ++i) values[static_cast<Eigen::Index>(i)] = number(prefix + std::string(names[i]));
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
  seen.translation = row.numbers("seen_marker_", positions);
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
  const auto hold = hold_reason_from_string(row.text("desired_hold"));
  if (!hold) row.complain("desired_hold", "none or why the goal can't be followed, see docs/statuses.md");
  input.desired.hold = *hold;
  return input;
}

}  // namespace

std::vector<std::string> decision_fields(const ServoDecision& decision) {
  Fields fields;
  add_decision(fields, decision);
  return fields.all;
}

InstrumentTruth truth_at(const FeatureModel& true_model, const JointVector& q) {
  InstrumentTruth truth{q.vector(), {}};
  if (const auto state = true_model ? true_model(truth.q) : std::nullopt) truth.features = state->features;
  return truth;
}

ServoLog::ServoLog(const std::filesystem::path& path)
    : path_(path), file_(path, row_of({.names = true}, 0, {}, {}, {})), thread_([this] { write_rows(); }) {}

ServoLog::~ServoLog() {
  rows_.close();
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
  if (rows_.try_push(row_of({}, tick_++, input, decision, truth))) return;
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
