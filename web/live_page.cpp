#include "web/live_page.h"

#include <algorithm>
#include <cmath>
#include <exception>
#include <nlohmann/json.hpp>
#include <utility>

#include <fmt/format.h>
#include <opencv2/imgcodecs.hpp>

#include "lapservo/core/csv.h"
#include "lapservo/io/overlay.h"
#include "web/page_files.h"
#include "web/page_state.h"

namespace lapservo::internal {
namespace {

constexpr auto between_drawings = std::chrono::milliseconds(25), recent = std::chrono::milliseconds(100);
constexpr int jpeg_quality = 80;
constexpr std::size_t most_events = 8;

double seconds(std::chrono::steady_clock::duration duration) {
  return std::chrono::duration<double>(duration).count();
}

HttpResponse plain(int status, const std::string& text) {
  return {status, "text/plain; charset=utf-8", text + "\n"};
}

std::optional<HttpResponse> file_at(const std::string& path) {
  if (path == "/") return HttpResponse{200, "text/html; charset=utf-8", page_html};
  if (path == "/page.css") return HttpResponse{200, "text/css; charset=utf-8", page_css};
  if (path == "/page.js") return HttpResponse{200, "text/javascript; charset=utf-8", page_js};
  return std::nullopt;
}

// The number in ?after=; an image's numbers begin with 1.
long after_of(const HttpRequest& request) {
  const auto after = request.query.find("after");
  if (after == request.query.end()) return 0;
  const auto number = parse_finite(after->second);
  return number && *number >= 0 && *number < 1e15 ? std::lround(*number) : 0;
}

std::string jpeg_of(const PageImage& image) {
  std::vector<unsigned char> bytes;
  cv::imencode(".jpg", draw_overlay(image.bgr, *image.rig, image.observations), bytes,
               {cv::IMWRITE_JPEG_QUALITY, jpeg_quality});
  return {bytes.begin(), bytes.end()};
}

}  // namespace

LivePage::LivePage(const PageConfig& config)
    : config_(config),
      token_(is_loopback(config.address, "--listen") ? "" : random_token()),
      access_(token_.empty(), token_),
      told_(std::chrono::steady_clock::now()) {
  server_ =
      std::make_unique<HttpServer>(config.address, config.port, config.option, config.limits,
                                   [this](const HttpRequest& request, bool last) { return answer(request, last); });
  thread_ = std::thread([this] { draw(); });
}

LivePage::~LivePage() {
  {
    const std::lock_guard lock(mutex_);
    ended_ = true;
  }
  changed_.notify_all();
  thread_.join();
  server_.reset();
}

std::string LivePage::url() const {
  const bool v6 = config_.address.find(':') != std::string::npos;
  return fmt::format("http://{}:{}/{}", v6 ? "[" + config_.address + "]" : config_.address, server_->port(),
                     token_.empty() ? "" : "?token=" + token_);
}

void LivePage::show(PageImage image) {
  const std::unique_lock lock(mutex_, std::try_to_lock);
  if (!lock) return;
  const auto age = std::chrono::duration_cast<Time::duration>(std::chrono::duration<double>(image.age_s));
  newest_.came = std::chrono::steady_clock::now() - age;
  std::swap(newest_.image, image);  // the one before ends after the lock
  ++number_;
  if (watched_) changed_.notify_one();
}

void LivePage::tell(const PageLoop& loop, const std::string& state) {
  if (untold_.empty() ? state != state_ : state != untold_.back().state) untold_.push_back({loop.time_s, state});
  const std::unique_lock lock(mutex_, std::try_to_lock);
  if (!lock) return;
  loop_ = loop;
  told_ = std::chrono::steady_clock::now();
  if (untold_.empty()) return;
  state_ = untold_.back().state;
  events_.insert(events_.begin(), untold_.rbegin(), untold_.rend());
  events_.resize(std::min(events_.size(), most_events));
  untold_.clear();
}

PageWishes LivePage::take_wishes() {
  const Wish wish = wish_.exchange(Wish::none);
  PageWishes wishes;
  if (wish != Wish::none) wishes.hold = wish == Wish::hold;
  wishes.stop = stop_;
  return wishes;
}

std::optional<HttpResponse> LivePage::answer(const HttpRequest& request, bool last) {
  if (auto refusal = access_.refuse(request)) return refusal;
  if (request.method == "POST") return command(request.path);
  if (request.method != "GET") return plain(405, "GET and POST only");
  if (request.path == "/picture") return picture(request, last);
  if (request.path == "/state") return state();
  if (auto file = file_at(request.path)) return file;
  return plain(404, "there is no such page");
}

// Whoever has one asks for the next: none waits in a socket where the way is slow.
std::optional<HttpResponse> LivePage::picture(const HttpRequest& request, bool last) {
  const long after = after_of(request);
  std::unique_lock lock(mutex_);
  const auto drawn = drawn_;
  const auto now = std::chrono::steady_clock::now();
  const bool current = drawn && (drawn->number == number_ || now < drawn->done + recent);
  if (!current || drawn->number == after) {
    watched_ = true;
    lock.unlock();
    changed_.notify_one();
    return last ? std::optional(HttpResponse{204, "text/plain; charset=utf-8", ""}) : std::nullopt;
  }
  lock.unlock();
  return HttpResponse{200,
                      "image/jpeg",
                      drawn->jpeg,
                      {{"X-Number", std::to_string(drawn->number)},
                       {"X-Came-S", fmt::format("{:.4f}", seconds(drawn->came.time_since_epoch()))}}};
}

HttpResponse LivePage::command(const std::string& path) {
  if (path == "/stop") {
    stop_ = true;
    return plain(202, "the run ends");
  }
  if (path != "/hold" && path != "/start") return plain(404, "there is no such command");
  if (!config_.has_loop) return plain(403, "nothing here moves");
  if (path == "/start" && !config_.may_start) return plain(403, "lapservo runs without --enable-motion");
  wish_ = path == "/hold" ? Wish::hold : Wish::start;
  return plain(202, "asked for");
}

HttpResponse LivePage::state() {
  nlohmann::ordered_json state{{"title", config_.title},
                               {"has_loop", config_.has_loop},
                               {"may_start", config_.may_start},
                               {"live", config_.live}};
  const auto now = std::chrono::steady_clock::now();
  state["now_s"] = seconds(now.time_since_epoch());
  std::vector<Observation> observations;
  {
    const std::lock_guard lock(mutex_);
    observations = newest_.image.observations;
    state["image_age_s"] = number_ > 0 ? nlohmann::ordered_json(seconds(now - newest_.came)) : nlohmann::ordered_json();
    state["images"] = number_;
    state["loop"] = loop_ ? json_of(*loop_) : nlohmann::ordered_json();
    state["loop_age_s"] = seconds(now - told_);
    state["events"] = nlohmann::ordered_json::array();
    for (const Event& event : events_) state["events"].push_back({{"time_s", event.time_s}, {"state", event.state}});
  }
  state["instruments"] = json_of(observations);
  state["asked"] = wish_ == Wish::none ? "" : wish_ == Wish::hold ? "hold" : "start";
  return {200, "application/json", text_of(state)};
}

void LivePage::draw() {
  lower_priority();
  std::unique_lock lock(mutex_);
  while (true) {
    changed_.wait(lock,
                  [this] { return ended_ || (watched_ && number_ > 0 && (!drawn_ || number_ > drawn_->number)); });
    if (ended_) return;
    watched_ = false;
    const Waiting waiting = newest_;
    auto drawn = std::make_shared<Drawn>(Drawn{number_, waiting.came, {}, {}});
    lock.unlock();
    const auto begin = std::chrono::steady_clock::now();
    try {
      drawn->jpeg = jpeg_of(waiting.image);
      drawn->done = std::chrono::steady_clock::now();
    } catch (const std::exception&) {
      drawn.reset();  // the next one, perhaps
    }
    lock.lock();
    if (drawn) drawn_ = std::move(drawn);
    lock.unlock();
    server_->wake();
    std::this_thread::sleep_until(begin + between_drawings);
    lock.lock();
  }
}

}  // namespace lapservo::internal
