#include "lapservo/rig/calibration_record.h"

#include <algorithm>
#include <cstdint>
#include <fstream>
#include <limits>
#include <system_error>

#include <fmt/format.h>
#include <yaml-cpp/yaml.h>

#include "lapservo/core/atomic_file.h"
#include "lapservo/core/known_keys.h"
#include "lapservo/core/yaml_field.h"
#include "lapservo/rig/rig.h"
#include "lapservo/rig/rig_files.h"

namespace lapservo::internal {
namespace fs = std::filesystem;

const CalibrationStep* CalibrationRecord::find(const std::string& name) const {
  const auto step = std::find_if(steps.begin(), steps.end(), [&](const auto& s) { return s.name == name; });
  return step == steps.end() ? nullptr : &*step;
}

void CalibrationRecord::add(const CalibrationStep& step) {
  const auto place = [](const std::string& name) {
    return std::find(calibration_order.begin(), calibration_order.end(), name);
  };
  std::erase_if(steps, [&](const auto& s) { return place(s.name) >= place(step.name); });
  steps.push_back(step);
}

fs::path record_path(const fs::path& rig) {
  return fs::path(rig).replace_extension(".calibration.yaml");
}

CalibrationRecord read_record(const fs::path& path) {
  CalibrationRecord record;
  std::error_code error;
  if (!fs::exists(path, error)) return record;
  const YamlField root = YamlField::read(path, "calibration record");
  expect_keys(root, {{"rig", "steps"}, {}});
  record.rig = root["rig"].text("what the rig file was");
  for (const YamlField& entry : root["steps"].list("steps")) {
    expect_keys(entry, {{"name", "command", "inputs", "when"}, {}});
    const auto text = [&](const char* key) { return entry[key].text("a text"); };
    record.steps.push_back(
        {text("name"), text("command"), entry["inputs"].present() ? text("inputs") : "", text("when")});
  }
  return record;
}

void write_record(const fs::path& path, const CalibrationRecord& record) {
  YAML::Emitter out;
  out << YAML::BeginMap << YAML::Key << "rig" << YAML::Value << record.rig << YAML::Key << "steps" << YAML::BeginSeq;
  for (const CalibrationStep& step : record.steps) {
    out << YAML::BeginMap << YAML::Key << "name" << YAML::Value << step.name << YAML::Key << "command" << YAML::Value
        << step.command;
    if (!step.inputs.empty()) out << YAML::Key << "inputs" << YAML::Value << step.inputs;
    out << YAML::Key << "when" << YAML::Value << step.when << YAML::EndMap;
  }
  out << YAML::EndSeq << YAML::EndMap;
  write_file(
      path,
      std::string("# The calibrations by `lapservo calibrate all` of the rig beside this file, with their times.\n") +
          out.c_str() + "\n");
}

std::string content_state(const fs::path& path) {
  std::error_code error;
  if (!fs::is_regular_file(path, error)) return {};
  std::ifstream file(path, std::ios::binary);
  if (!file) return {};
  std::uint64_t hash = 14695981039346656037U;
  std::array<char, 4096> bytes;
  while (file.read(bytes.data(), bytes.size()), file.gcount() > 0)
    for (std::streamsize i = 0; i < file.gcount(); ++i)
      hash = (hash ^ static_cast<unsigned char>(bytes[static_cast<std::size_t>(i)])) * 1099511628211U;
  return fmt::format("fnv1a-{:016x}", hash);
}

std::string rig_state(const fs::path& path) {
  const Rig rig = load_rig(path);
  std::string state = content_state(path);
  each_file(rig, [&](const fs::path& file) { state.append(" ").append(content_state(file)); });
  return state;
}

std::string input_state(const fs::path& path) {
  std::uint64_t bytes = 0, files = 0;
  std::int64_t changed = std::numeric_limits<std::int64_t>::min();  // the last of them; now is below 0 in this clock
  const auto add = [&](const fs::path& file) {
    std::error_code error;
    const auto size = fs::file_size(file, error);
    const auto time = fs::last_write_time(file, error);
    if (error) return;
    bytes += size, ++files;
    changed = std::max<std::int64_t>(changed, time.time_since_epoch().count());
  };
  std::error_code error;
  if (fs::is_directory(path, error)) {
    for (const auto& entry : fs::directory_iterator(path, error))
      if (entry.is_regular_file(error)) add(entry.path());
  } else if (fs::is_regular_file(path, error)) {
    add(path);
  }
  return files == 0 ? std::string() : fmt::format("{} files, {} bytes, {}", files, bytes, changed);
}

}  // namespace lapservo::internal
