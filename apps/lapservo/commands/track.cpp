#include <algorithm>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <string>
#include <system_error>
#include <thread>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "apps/lapservo/cli/interrupt.h"
#include "apps/lapservo/cli/progress.h"
#include "apps/lapservo/cli/subcommands.h"
#include "apps/lapservo/cli/web_view.h"
#include "apps/lapservo/inputs/frame_input.h"
#include "apps/lapservo/inputs/input_files.h"
#include "apps/lapservo/inputs/joint_input.h"
#include "apps/lapservo/inputs/live_images.h"
#include "apps/lapservo/inputs/transports.h"
#include "cameras/live_source.h"
#include "lapservo/calibration/check/frame_diagnosis.h"
#include "lapservo/core/error.h"
#include "lapservo/core/row_file.h"
#include "lapservo/crtk/transport.h"
#include "lapservo/crtk/wrist_history.h"
#include "lapservo/io/frame_source.h"
#include "lapservo/io/image_file.h"
#include "lapservo/io/overlay.h"
#include "lapservo/io/tables/observation_csv.h"
#include "lapservo/io/video/overlay_writer.h"
#include "lapservo/io/video/video_writer.h"
#include "lapservo/rig/registration_covariance.h"
#include "lapservo/robot/steady_clock.h"
#include "lapservo/servo/registration_watch.h"
#include "lapservo/tool/wrist.h"
#include "lapservo/vision/tracker.h"

namespace lapservo::app {
using namespace internal;
namespace {
namespace fs = std::filesystem;

struct TrackOptions : RecordingOptions {
  std::string out = "obs.csv", overlay, method = "surface", publish, tf_frames = default_frames;
  bool single = false;
  WebOptions web;
  bool page_only = false;  ///< `lapservo view`: at the input's own pace, and without --out
  int frames = 0;
};

// The node's name, in all of the command that reads a topic's images.
constexpr auto live_node_name = "lapservo_track";

// A topic's images as frames to be measured: the newest each time, until Ctrl-C.
class LiveFrames : public LiveSource {
 public:
  LiveFrames(const std::string& text, const Camera& camera)
      : LiveSource(interrupted),
        text_(text),
        transports_(live_node_name),
        images_(text, "input", camera, clock_, transports_) {}

  /// Age of the last frame, since its arrival.
  double age_s() const { return clock_.now_s() - last_s_; }
  /// Counts of unusable images, in words; empty when there were none.
  std::string dropped() const { return images_.counts().text(); }

 protected:
  std::optional<StampedImage> take() override {
    auto image = images_.newest();
    if (image) last_s_ = image->time_s;
    if (!image) std::this_thread::sleep_for(std::chrono::milliseconds(1));
    return image;
  }
  std::optional<std::string> ended() const override { return images_.ended(); }
  std::string why_none() override {
    return dropped().empty() ? transports_.unpublished(text_, "input") : images_.complaint();
  }

 private:
  std::string text_;
  Transports transports_;
  LiveImages images_;
  double last_s_ = 0;
};

// The joints of wrists as a topic has them.
class LiveWrist {
 public:
  /// `topic`: "ros2:/PSM1/measured_js". Throws InputError for another text and a transport that this build lacks.
  explicit LiveWrist(const std::string& topic) {
    const Address address = address_of(topic, "--joints");
    transport_ = make_transport(address.transport, "lapservo_wrist", "--joints");
    subscription_ = transport_->subscribe<JointMessage>(address.name, [this](JointMessage&& message) {
      const std::lock_guard lock(mutex_);
      history_.add(std::move(message), clock_.now_s());
    });
  }

  /// At the exposure of a frame that arrived at this time of SteadyClock, in the order of Tool::wrist; empty where no
  /// message that came near then has all of them.
  std::vector<double> at_exposure(const Instrument& instrument, double arrival_s) const {
    // A longer delay, or one below 0, is that of a recording by two clocks.
    const double delay_s = instrument.image_delay_s.value_or(0);
    const double exposure_s = arrival_s - (delay_s >= 0 && delay_s <= WristHistory::longest_delay_s ? delay_s : 0);
    const std::lock_guard lock(mutex_);
    return history_.at(wrist_names(instrument.tool), exposure_s);
  }

 private:
  SteadyClock clock_;
  std::unique_ptr<Transport> transport_;
  mutable std::mutex mutex_;
  WristHistory history_;
  Transport::Subscription subscription_;  // last: it uses the others
};

// The inputs that are known before the first frame; rigs beside the frames come with them.
InputFiles inputs_of(const TrackOptions& options) {
  InputFiles inputs;
  inputs.add_recording(options.input), inputs.add(options.joints);
  return inputs;
}

void refuse_outputs(const TrackOptions& options, const InputFiles& inputs) {
  inputs.refuse_as_output(options.out);
  inputs.refuse_as_output(options.overlay);
  inputs.refuse_in_folder(options.overlay);
  refuse_shared_place({options.out, options.overlay});
}

void expect_wrist(const TrackOptions& options, const fs::path& path, const Rig& rig) {
  const bool has_wrist = std::ranges::any_of(
      rig.instruments, [](const Instrument& instrument) { return instrument.tool && !instrument.tool->wrist.empty(); });
  if (!options.joints.empty() && !has_wrist)
    throw InputError("--joints", fmt::format("is {}, expected a tool with a wrist in {}, whose joints it would have",
                                             options.joints, path.string()));
}

// Which rig a frame is to be tracked with: the one named by --rig, else NAME.rig.yaml beside the image, else rig.yaml
// in its folder. The tracker begins anew when the rig changes.
class RigByFrame {
 public:
  explicit RigByFrame(const TrackOptions& options)
      : options_(options),
        tracking_{.method = method_from_string(options.method).value(),
                  .single = options.single,
                  .deinterlace = options.deinterlace} {
    if (!options.rig.empty()) use(options.rig);
  }

  Tracker& tracker_for(const Frame& frame) {
    if (options_.rig.empty()) {
      fs::path at = frame.file.empty() ? fs::path(options_.input) : frame.file;
      if (!at.has_filename()) at = at.parent_path();  // a folder's name may end in /
      const fs::path own = sidecar(at), shared = at.parent_path() / "rig.yaml";
      const fs::path chosen = is_there(own) ? own : shared;
      if (!is_there(chosen))
        throw InputError(at.string(),
                         "has no rig beside it (" + own.filename().string() + " or rig.yaml): name one with --rig");
      if (chosen != path_) use(chosen);
    } else if (!frame.file.empty() && !warned_ && has_other_rig(frame.file)) {
      std::fprintf(stderr, "lapservo: note: --rig is used for all frames, though %s has a rig of its own\n",
                   frame.file.filename().c_str());
      warned_ = true;
    }
    if (!tracker_) tracker_.emplace(*rig_, tracking_);
    return *tracker_;
  }
  /// The frames may be unrelated images: each is searched whole.
  void expect_pictures() { tracking_.frame_budget.reset(); }
  const std::shared_ptr<const Rig>& rig() const { return rig_; }
  /// Those that were found beside the input, in words; empty where --rig names one.
  std::string found() const {
    if (!options_.rig.empty() || found_.empty()) return {};
    const std::string first = found_.begin()->string();
    return found_.size() == 1 ? first : fmt::format("{} and {} more beside their images", first, found_.size() - 1);
  }
  /// Null while no rig is known.
  const Camera* camera() const { return rig_ ? &rig_->camera : nullptr; }

 private:
  bool has_other_rig(const fs::path& picture) const {
    std::error_code error;
    return fs::exists(sidecar(picture), error) && !fs::equivalent(sidecar(picture), options_.rig, error);
  }
  // A link to no file, too: load_rig() names it.
  static bool is_there(const fs::path& rig) {
    std::error_code error;
    return fs::exists(fs::symlink_status(rig, error));
  }
  static fs::path sidecar(const fs::path& file) { return fs::path(file).replace_extension(".rig.yaml"); }
  void use(const fs::path& path) {
    rig_ = std::make_shared<const Rig>(load_rig(path));
    expect_wrist(options_, path, *rig_);
    InputFiles inputs;
    inputs.add_rig(path, *rig_);
    refuse_outputs(options_, inputs);
    path_ = path;
    found_.insert(path);
    tracker_.reset();
  }

  const TrackOptions& options_;
  TrackerOptions tracking_;
  fs::path path_;
  std::set<fs::path> found_;
  std::shared_ptr<const Rig> rig_;
  std::optional<Tracker> tracker_;
  bool warned_ = false;
};

struct Tally {
  int frames = 0;
  std::map<std::string, int> found;
  std::map<std::pair<std::string, Status>, int> refused;

  void add(const std::vector<Observation>& observations) {
    ++frames;
    for (const Observation& observation : observations) {
      found[observation.instrument] += observation.status == Status::ok;
      if (observation.status != Status::ok) ++refused[{observation.instrument, observation.status}];
    }
  }
  std::string text() const {
    std::string line;
    for (const auto& [name, count] : found) line += fmt::format(", {} in {}", name, count);
    return line;
  }
  // Blending has frames refused for other reasons, too.
  void print_refused() const {
    for (const auto& [of, count] : refused) {
      const bool by_blending = refused.contains({of.first, Status::blended}) && comes_by_compression(of.second);
      std::printf("  %s: %d %s: %s\n", of.first.c_str(), count, std::string(to_string(of.second)).c_str(),
                  usual_cause(by_blending ? Status::blended : of.second));
    }
  }
  bool anything() const {
    return std::any_of(found.begin(), found.end(), [](const auto& entry) { return entry.second > 0; });
  }
};

void say_moved(const TrackOptions& options, const Frame& frame, int frames_ago) {
  std::fprintf(stderr,
               "lapservo: %s: the endoscope moved: from %d frames before frame %d (%.2f s) on %s, and q is empty or "
               "off: %s\n",
               options.input.c_str(), frames_ago, frame.index, frame.time_s, misses_rcm_text,
               measure_registration_text);
}

// Null where the frames are no topic's.
std::unique_ptr<LiveFrames> open_topic(const TrackOptions& options, const RigByFrame& rigs) {
  if (!rigs.camera() && (names_topic(options.input) || options.input.starts_with("gst:")))
    throw InputError("--rig", "is missing, expected a rig's YAML: live images have none beside them");
  return names_topic(options.input) ? std::make_unique<LiveFrames>(options.input, *rigs.camera()) : nullptr;
}

PageConfig page_config_of(const TrackOptions& options, const FrameSource& source) {
  PageConfig config;
  config.title = (options.page_only ? "view " : "track ") + options.input;
  config.live = source.kind() == FrameSource::Kind::live;
  return config;
}

// Until then, or until somebody wants the end.
void wait_on_page(WebView& web, const std::function<bool()>& done) {
  SteadyClock clock;
  while (!interrupted() && !web.take_wishes().stop && !done()) clock.sleep_until(clock.now_s() + 0.005);
}

// /tf and the rest of FrameTopics, of the rig that is known with the first frame.
struct Publishing {
  explicit Publishing(const TrackOptions& options)
      : frames(frame_names_of(options.tf_frames)),
        transport(make_transport(options.publish, live_node_name, "--publish")) {}
  void publish(const Rig& rig, const std::vector<Observation>& observations, double age_s) {
    if (!topics) topics.emplace(*transport, rig, frames);
    for (std::size_t i = 0; i < observations.size(); ++i)
      topics->publish(i, observations[i], rig.instruments[i].camera_from_rcm, transport->stamp_now_s() - age_s);
  }

  FrameNames frames;
  std::unique_ptr<Transport> transport;
  std::optional<FrameTopics> topics;  // last: it uses the transport
};

// One run of either command: where frames come from, and where what was seen in them goes.
class TrackRun {
 public:
  explicit TrackRun(const TrackOptions& options)
      : options_(options),
        rigs_(options),
        live_(open_topic(options, rigs_)),
        file_(live_ ? nullptr : open_frames(options.input, options, rigs_.camera())),
        source_(live_ ? static_cast<FrameSource&>(*live_) : *file_) {
    if (source_.kind() == FrameSource::Kind::image || source_.kind() == FrameSource::Kind::folder)
      rigs_.expect_pictures();
    if (names_topic(options.joints)) live_wrist_.emplace(options.joints);
    if (!options.publish.empty()) publishing_.emplace(options);
    if (options.web.port) web_ = open_page(options.web, page_config_of(options, source_));
    refuse_other_kind(options.out, ".csv");
    if (!options.page_only) csv_.emplace(options.out, observation_csv_header);
    if (!options.overlay.empty()) overlay_.emplace(options.overlay, source_);
  }

  /// The command's exit code.
  int run() {
    watch_for_interrupts();
    if (plays_a_file()) wait_on_page(*web_, [this] { return web_->was_watched(); });
    begin_s_ = clock_.now_s();
    try {
      track_all();
    } catch (const InputError& error) {
      fail_with_rows(error);
    }
    if (plays_a_file() && !stopped_) {
      std::fprintf(stderr, "lapservo: %s has ended; the page stays until Ctrl-C\n", options_.input.c_str());
      web_->end();
      wait_on_page(*web_, [] { return false; });
    }
    // A camera has no end but this.
    if (stopped_ && source_.kind() != FrameSource::Kind::live) return leave_unfinished();
    if (csv_) csv_->commit();
    if (overlay_) overlay_->commit();
    tell_results();
    say_without_readings();
    return tell_complaints();
  }

 private:
  int leave_unfinished() {
    std::fprintf(stderr, "lapservo: %s: stopped after %d frames%s%s\n", options_.input.c_str(), tally_.frames,
                 csv_ ? "; their observations: " : "", csv_ ? csv_->leave().c_str() : "");
    return 1;
  }

  // In an exception's handler. Rows of frames before stay, as those of a stop do.
  [[noreturn]] void fail_with_rows(const InputError& error) {
    const std::string rows = csv_ && passed_on_ > 0 ? csv_->leave().string() : options_.out;
    if (rows == options_.out) throw;  // none, or where the rows are written is what failed
    const std::string problem = std::string(error.what()).substr(error.source().size() + 2);
    throw InputError(error.source(),
                     fmt::format("{}; the observations of {} frames before are in {}", problem, passed_on_, rows));
  }

  // On a page alone, at the speed of the recording.
  bool plays_a_file() const { return options_.page_only && source_.kind() != FrameSource::Kind::live; }

  void track_all() {
    Progress progress(source_.frame_count());
    while (!(stopped_ = interrupted()) && (options_.frames == 0 || tally_.frames < options_.frames)) {
      const auto frame = source_.next();
      if (!frame) {
        stopped_ = interrupted();
        read_to_the_end_ = true;
        return;
      }
      const double came_s = clock_.now_s() - (live_ ? live_->age_s() : 0);
      Tracker& tracker = rigs_.tracker_for(*frame);
      try {
        if (rig_ != rigs_.rig()) begin_rig();
        set_wrists(tracker, *frame, came_s);
        const auto& observations =
            frame->flaw ? tracker.refuse(*frame->flaw) : tracker.track(frame->bgr, frame->time_s);
        tally_.add(observations);
        for (std::size_t i = 0; i < observations.size(); ++i) wrists_[i].add(observations[i], frame->time_s);
        if (const auto frames_ago = registration_.add(observations)) say_moved(options_, *frame, *frames_ago);
        lossy_ |= has_jpeg_extension(frame->file);
        diagnosis_->add(frame->bgr, observations);
        if ((stopped_ = !pass_on(*frame, observations, came_s))) return;
        ++passed_on_;
      } catch (const InputError& error) {
        if (error.source() != "image") throw;
        throw error.with_source(frame->file.empty() ? options_.input : frame->file.string());
      }
      progress.show(tally_.frames, tally_.text());
      const double next_s = begin_s_ + frame->time_s + 1 / source_.frames_per_second();
      if (plays_a_file()) wait_on_page(*web_, [this, next_s] { return clock_.now_s() >= next_s; });
    }
  }

  // Says once a rig why an instrument has no tip, or which point it is.
  void begin_rig() {
    say_without_readings();
    rig_ = rigs_.rig();
    diagnosis_.emplace(*rig_, options_.deinterlace || rig_->camera.deinterlace);
    if (publishing_) publishing_->topics.reset();
    wrists_.clear();
    for (std::size_t i = 0; i < rig_->instruments.size(); ++i) {
      wrists_.push_back(live_wrist_ ? WristInput{std::nullopt, other_wrist_text(options_.joints, *rig_, i)}
                                    : find_wrist_input(options_, *rig_, i, source_, true));
      const std::string why = no_tip_text(rig_->instruments[i], wrists_[i]);
      say_no_tip(rig_->instruments[i], why);
      if (why.empty()) say_axis_tip(rig_->instruments[i]);
    }
  }

  // Readings of the wrists at the frame's exposure.
  void set_wrists(Tracker& tracker, const Frame& frame, double came_s) {
    for (std::size_t i = 0; i < wrists_.size(); ++i) {
      const Instrument& instrument = rig_->instruments[i];
      if (!instrument.tool) continue;
      const bool is_live = live_wrist_ && wrists_[i].none.empty();
      tracker.set_wrist(
          i, is_live ? live_wrist_->at_exposure(instrument, came_s) : wrist_at(wrists_[i], instrument, frame.time_s));
    }
  }

  static void say_no_tip(const Instrument& instrument, const std::string& why) {
    if (!why.empty()) std::fprintf(stderr, "lapservo: %s: no tip: %s\n", instrument.name.c_str(), why.c_str());
  }

  // Once behind the frames of a rig.
  void say_without_readings() const {
    for (std::size_t i = 0; i < wrists_.size(); ++i) {
      const Instrument& instrument = rig_->instruments[i];
      say_no_tip(instrument, no_reading_text(instrument, wrists_[i]));
    }
  }

  // To all that want it; false when somebody who looks wants the end.
  bool pass_on(const Frame& frame, const std::vector<Observation>& observations, double came_s) {
    for (const Observation& observation : observations)
      if (csv_) csv_->add(observation_csv_row(frame.index, frame.time_s, frame.file.filename().string(), observation));
    if (overlay_) overlay_->add(frame, draw_overlay(frame.bgr, *rigs_.rig(), observations));
    if (publishing_) publishing_->publish(*rig_, observations, clock_.now_s() - came_s);
    if (!web_) return true;
    web_->show({frame.bgr, rigs_.rig(), observations, clock_.now_s() - came_s});
    return !web_->take_wishes().stop;
  }

  void tell_results() const {
    std::printf("%s%d frames%s\n", stopped_ ? "stopped after " : "", tally_.frames, tally_.text().c_str());
    tally_.print_refused();
    if (tally_.anything())
      for (const Instrument& instrument : rigs_.rig()->instruments)
        if (const std::string exact = exact_registration_text(instrument); !exact.empty())
          std::printf("  %s\n", exact.c_str());
    if (!rigs_.found().empty()) std::printf("rig: %s\n", rigs_.found().c_str());
    if (csv_) std::printf("observations: %s\n", options_.out.c_str());
    if (overlay_) std::printf("overlay: %s\n", options_.overlay.c_str());
    if (overlay_ && overlay_->is_video() && !video_remark().empty())
      std::printf("overlay: %s\n", video_remark().c_str());
    if (live_ && !live_->dropped().empty()) std::printf("no frames: %s\n", live_->dropped().c_str());
  }

  int tell_complaints() const {
    if (const std::string complaint = read_to_the_end_ && !stopped_ ? source_.complaint() : ""; !complaint.empty()) {
      std::fprintf(stderr, "lapservo: %s: %s: what could be read is measured\n", options_.input.c_str(),
                   complaint.c_str());
      return 1;
    }
    const std::string diagnosis = diagnosis_ ? diagnosis_->text(lossy_ || source_.is_lossy()) : "no frame came";
    if (!diagnosis.empty()) std::fprintf(stderr, "lapservo: %s: %s\n", options_.input.c_str(), diagnosis.c_str());
    return tally_.anything() ? 0 : 1;
  }

  const TrackOptions& options_;
  RigByFrame rigs_;
  std::unique_ptr<LiveFrames> live_;
  std::unique_ptr<FrameSource> file_;
  FrameSource& source_;
  std::optional<Publishing> publishing_;
  std::unique_ptr<WebView> web_;
  std::optional<RowFile> csv_;
  std::optional<OverlayWriter> overlay_;
  std::optional<LiveWrist> live_wrist_;
  std::shared_ptr<const Rig> rig_;  // the last frame's
  std::vector<WristInput> wrists_;  // of its instruments
  SteadyClock clock_;
  double begin_s_ = 0;
  Tally tally_;
  int passed_on_ = 0;  // frames
  RegistrationWatch registration_;
  std::optional<FrameDiagnosis> diagnosis_;  // of frames with that rig
  bool stopped_ = false, read_to_the_end_ = false, lossy_ = false;
};

// Options that would be ignored.
void refuse_idle(const TrackOptions& options, const Command& command) {
  refuse_idle_joint_topic(options);
  if (!names_topic(options.input)) return;
  std::vector<std::string> of_recordings = frame_option_names();
  std::erase(of_recordings, "--deinterlace");
  command.refuse(of_recordings, "is of recordings, expected none with a topic");
}

int run(const TrackOptions& options, const Command& command) {
  options.web.check();
  refuse_idle(options, command);
  refuse_outputs(options, inputs_of(options));
  return TrackRun(options).run();
}

// Options of both commands.
void add_input_options(Command command, TrackOptions& options) {
  command.add_option(
      "input", options.input, required(),
      "Image, folder of images, video file, bag of ROS 1 or 2, camera (0, /dev/video0), stream (rtsp://...), topic "
      "(ros2:/image_raw, ros1:/image_raw/compressed) or GStreamer pipeline without its sink (gst:decklinkvideosrc)");
  add_image_topic_option(command, options.image_topic);
  add_video_options(command, options);
  command.add_option("--rig", options.rig,
                     "Camera and instruments; without it NAME.rig.yaml or rig.yaml beside the input");
  command.add_option("--joints", options.joints,
                     "Readings of a tool's wrist, for the tip: a CSV (time_s and a column a joint), a bag, or a topic "
                     "(ros2:/PSM1/measured_js); without it those in the input, where it is a bag");
  add_joint_topic_option(command, options.joint_topic);
  command.add_option("--method", options.method, one_of({"surface", "centerline"}),
                     "surface: all visible lines; centerline: the paper's Algorithm 1");
  command.add_flag("--single", options.single, "Treat every frame on its own, without tracking from the frame before");
  command.add_flag("--deinterlace", options.deinterlace,
                   "For interlaced video (status: interlaced): track the field of the even rows; the same as "
                   "deinterlace: true in the rig's camera");
  command.add_option("--fps", options.fps, between(0.001, 100000.0), "Frames per second of a folder's images; else 30");
}

}  // namespace

void add_track(Command app) {
  auto [command, options] = app.add_subcommand<TrackOptions>(
      "track", "Measure the instruments in images, a video, a bag or a camera's frames.", run);
  add_input_options(command, options);
  command.add_option("--out", options.out,
                     "CSV of observations, replacing one of that name when all is measured; until then, and if the run "
                     "is stopped, the rows are in NAME.part, which the next run of that name writes over");
  command.add_option(
      "--overlay", options.overlay,
      "Write images (a folder) or a video (.mp4) with the detection drawn in, replacing those of the same name");
  add_web_options(command, options.web);
  command.add_option("--publish", options.publish, one_of({"ros2", "ros1"}),
                     "Publish /tf, poses and markers over this transport, see docs/messages.md#frames");
  add_frame_names_option(command, options.tf_frames);
  command.add_option("--frames", options.frames, whole_between(0, 1000000000),
                     "End after so many; 0: all, a camera's until Ctrl-C");
  command.footer("Example:\n  lapservo track video.mp4 --rig rig.yaml --out obs.csv --overlay overlay.mp4");
}

void add_view(Command app) {
  auto [command, options] = app.add_subcommand<TrackOptions>(
      "view", "Show what is measured in images, a video or a camera's frames on a page.", run);
  options.page_only = true;
  options.out.clear();
  add_input_options(command, options);
  add_web_options(command, options.web, true);
  command.footer(
      "Files are shown at their own pace, once, when a browser shows the page. A browser on another computer reaches "
      "the page by\n"
      "ssh -L 8080:localhost:8080 THIS_COMPUTER, or with --listen by the address that is printed.\n"
      "Example:\n"
      "  lapservo view ros2:/endoscope/image_raw --rig rig.yaml");
}

}  // namespace lapservo::app
