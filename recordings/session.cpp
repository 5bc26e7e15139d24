#include "recordings/session.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <limits>
#include <nlohmann/json.hpp>
#include <numeric>
#include <optional>
#include <system_error>
#include <tuple>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "lapservo/core/error.h"
#include "lapservo/core/statistics.h"

namespace lapservo::internal {
namespace {
namespace fs = std::filesystem;
using nlohmann::json;

constexpr auto index_type = "dvrk_data:index@1.0.0", sidecar_type = "dvrk_data:video_sidecar@1.0.0";

const json& member(const json& object, const char* key) {
  static const json none;
  const auto found = object.is_object() ? object.find(key) : object.end();
  return found != object.end() ? *found : none;
}
std::string text_in(const json& object, const char* key) {
  const json& text = member(object, key);
  return text.is_string() ? text.get<std::string>() : std::string();
}
const json& list_in(const json& object, const char* key) {
  static const json empty = json::array();
  const json& list = member(object, key);
  return list.is_array() ? list : empty;
}

json read_json(const fs::path& path, const char* type, const json::parser_callback_t& each = nullptr) {
  std::ifstream file(path, std::ios::binary);
  if (!file) throw InputError(path.string(), std::string("can't be read, expected JSON of ") + type);
  json content = json::parse(file, each, false);
  if (content.is_discarded()) throw InputError(path.string(), std::string("is damaged, expected JSON of ") + type);
  if (const std::string found = text_in(content, "type"); found != type)
    throw InputError(path.string(), "type", found, type);
  return content;
}

// A file beside the index; of a longer path its name counts.
fs::path beside(const fs::path& folder, const std::string& file) {
  return folder / fs::path(file).filename();
}

std::optional<std::int64_t> time_in(const json& times, const char* key) {
  const json& time = member(times, key);
  const std::int64_t time_ns = time.is_number_integer() ? time.get<std::int64_t>() : 0;
  constexpr std::int64_t latest_ns = std::numeric_limits<std::int64_t>::max() / 2;  // the sum of two is a number, too
  return time_ns > 0 && time_ns < latest_ns ? std::optional(time_ns) : std::nullopt;
}

// A frame's times of each kind, in the order in which they are preferred.
using Times = std::array<std::optional<std::int64_t>, 5>;

Times times_of(const json& frame) {
  const json& times = member(member(frame, "cpu"), "realtime");
  const auto left = time_in(times, "left_source_ns"), right = time_in(times, "right_source_ns");
  const auto middle = left && right ? std::optional(std::midpoint(*left, *right)) : std::nullopt;
  return {time_in(times, "mono_source_ns"), middle, left, right, time_in(times, "recorder_reception_ns")};
}

struct Part {
  std::string video, layout;
  std::vector<Times> recorded;         // of the frames, until set_times()
  std::vector<std::int64_t> times_ns;  // of the frames
};

// Times of one kind for all frames of a stream: the first that any of them has. Another kind counts less what it is
// usually later.
void set_times(std::vector<Part>& parts) {
  std::size_t kind = std::tuple_size_v<Times>;
  const auto for_all = [&](const auto& look_at) {
    for (const Part& part : parts) std::ranges::for_each(part.recorded, look_at);
  };
  for_all([&](const Times& times) {
    const auto has = std::ranges::find_if(times, [](const auto& time_ns) { return time_ns.has_value(); });
    kind = std::min(kind, static_cast<std::size_t>(has - times.begin()));
  });
  Times later_ns;  // nullopt where no frame has both kinds
  for (std::size_t i = 0; i < later_ns.size(); ++i) {
    std::vector<std::int64_t> all_ns;
    for_all([&](const Times& times) {
      if (times[i] && times[kind]) all_ns.push_back(*times[i] - *times[kind]);
    });
    if (!all_ns.empty()) later_ns[i] = median(all_ns);
  }
  for (Part& part : parts) {
    for (const Times& times : part.recorded) {
      std::optional<std::int64_t> known_ns, other_ns;
      for (std::size_t i = times.size(); i-- > 0;)
        if (times[i]) (later_ns[i] ? known_ns : other_ns) = *times[i] - later_ns[i].value_or(0);
      part.times_ns.push_back(known_ns ? *known_ns : other_ns.value());
    }
    part.recorded = {};
  }
}

Part read_sidecar(const fs::path& path) {
  Part sidecar;
  std::size_t wrong = 0;
  // A frame's record has 20 numbers, an hour 100,000 of them: none is kept.
  const auto take_frame = [&](int depth, json::parse_event_t event, json& parsed) {
    if (event != json::parse_event_t::object_end || depth != 2 || !parsed.contains("frame_index")) return true;
    const Times times = times_of(parsed);
    wrong += times == Times() || parsed["frame_index"] != sidecar.recorded.size();
    sidecar.recorded.push_back(times);
    return false;
  };
  sidecar.layout = text_in(read_json(path, sidecar_type, take_frame), "side_by_side");
  if (wrong > 0 || sidecar.recorded.empty())
    throw InputError(path.string(),
                     fmt::format("has {} frames, {} of them without a time or out of turn, expected each "
                                 "frame's time",
                                 sidecar.recorded.size(), wrong));
  return sidecar;
}

class SessionFrames : public FrameSource {
 public:
  SessionFrames(std::vector<Part> parts, const VideoReading& reading) : parts_(std::move(parts)), reading_(reading) {
    open();
  }

  std::optional<Frame> next() override {
    while (true) {
      auto frame = video_->next();
      if (!frame) {
        end();
        if (part_ + 1 == parts_.size()) return std::nullopt;
        ++part_;
        open();
        continue;
      }
      const auto& times_ns = parts_[part_].times_ns;
      const std::size_t place = in_part_++;
      if (place >= times_ns.size()) continue;
      if (last_ns_ && times_ns[place] <= *last_ns_) {
        ++not_later_;
        continue;
      }
      last_ns_ = times_ns[place];
      frame->index = index_++;
      frame->time_s = 1e-9 * static_cast<double>(*last_ns_ - first_ns());
      return frame;
    }
  }
  Kind kind() const override { return Kind::video; }
  std::optional<int> frame_count() const override {
    std::size_t count = 0;
    for (const Part& part : parts_) count += part.times_ns.size();
    return static_cast<int>(count);
  }
  double frames_per_second() const override { return video_->frames_per_second(); }
  std::optional<double> first_stamp_s() const override { return 1e-9 * static_cast<double>(first_ns()); }
  std::string remark() const override { return video_->remark(); }
  bool is_srgb() const override { return video_->is_srgb(); }
  bool is_lossy() const override { return video_->is_lossy(); }
  std::string complaint() const override {
    std::vector<std::string> all = complaints_;
    if (not_later_ > 0)
      all.push_back(fmt::format("{} frames are left out, whose time is not later than the one before", not_later_));
    return fmt::format("{}", fmt::join(all, "; "));
  }

 private:
  std::int64_t first_ns() const { return parts_.front().times_ns.front(); }
  void open() {
    video_ = open_frame_source(parts_[part_].video, 30, reading_);
    in_part_ = 0;
  }
  void end() {
    const Part& part = parts_[part_];
    const std::string name = fs::path(part.video).filename().string();
    if (const std::string text = video_->complaint(); !text.empty()) complaints_.push_back(name + " " + text);
    if (in_part_ != part.times_ns.size())
      complaints_.push_back(fmt::format("{} has {} frames and {} times: they may not belong together", name, in_part_,
                                        part.times_ns.size()));
  }
  std::vector<Part> parts_;
  VideoReading reading_;
  std::unique_ptr<FrameSource> video_;
  std::size_t part_ = 0, in_part_ = 0;
  int index_ = 0, not_later_ = 0;
  std::optional<std::int64_t> last_ns_;
  std::vector<std::string> complaints_;
};

json index_of(const fs::path& folder) {
  return read_json(folder / "index.json", index_type);
}

// The stream of that name, or the only one with videos.
json stream_of(const fs::path& folder, const std::string& name) {
  std::vector<std::string> names;
  json found;
  const json index = index_of(folder);
  for (const json& stream : list_in(index, "streams")) {
    if (list_in(stream, "videos").empty() || (!name.empty() && text_in(stream, "name") != name)) continue;
    names.push_back(text_in(stream, "name"));
    found = stream;
  }
  if (names.size() != 1)
    throw InputError(folder.string(),
                     fmt::format("has {} video streams{} ({}), expected one, named by --image-topic", names.size(),
                                 name.empty() ? "" : " of the name " + name, fmt::join(names, ", ")));
  return found;
}

}  // namespace

bool is_session(const std::string& path) {
  std::error_code error;
  std::ifstream file(fs::path(path) / "index.json", std::ios::binary);
  if (!fs::is_directory(path, error) || !file) return false;
  return text_in(json::parse(file, nullptr, false), "type").starts_with("dvrk_data:index@");
}

std::string bag_of_session(const std::string& folder) {
  const std::string bag = text_in(index_of(folder), "rosbags");
  return bag.empty() ? std::string() : beside(folder, bag).string();
}

SessionVideo open_session(const std::string& folder, const std::string& stream, const VideoReading& reading) {
  SessionVideo session;
  std::vector<Part> parts;
  const json found = stream_of(folder, stream);
  for (const json& video : list_in(found, "videos")) {
    const fs::path file = beside(folder, text_in(video, "file"));
    Part part = read_sidecar(fs::path(file).replace_extension(".json"));
    part.video = file.string();
    session.layout = part.layout == "LR" || part.layout == "RL" ? part.layout : std::string();
    parts.push_back(std::move(part));
  }
  set_times(parts);
  session.frames = std::make_unique<SessionFrames>(std::move(parts), reading);
  return session;
}

}  // namespace lapservo::internal
