#include "web/live_page.h"

#include <algorithm>
#include <cmath>
#include <exception>
#include <nlohmann/json.hpp>
#include <utility>

#include <fmt/format.h>

#include "lapservo/core/csv.h"
#include "lapservo/core/joint_vector.h"
#include "lapservo/io/overlay.h"
#include "lapservo/io/pictures/jpeg_picture.h"
#include "lapservo/kinematics/feature_map.h"
#include "web/page_files.h"

namespace lapservo::internal {
namespace {

constexpr auto between_drawings = std::chrono::milliseconds(25), recent = std::chrono::milliseconds(100),
               between_looks = std::chrono::milliseconds(2);
constexpr auto watched = std::chrono::seconds(2), old = std::chrono::seconds(1);
constexpr double start_lasts_s = 1;
constexpr int jpeg_quality = 80;
constexpr std::size_t most_events = 8;

double seconds(std::chrono::steady_clock::duration duration) {
  return std::chrono::duration<double>(duration).count();
}

double now_s() {
  return seconds(std::chrono::steady_clock::now().time_since_epoch());
}

std::optional<double> number_of(const HttpRequest& request, const std::string& name) {
  const auto found = request.query.find(name);
  return found == request.query.end() ? std::nullopt : parse_finite(found->second);
}

// When the page sent it, by this clock: what the network or a stopped process kept back is not wanted any more.
std::optional<double> time_of(const HttpRequest& request) {
  return number_of(request, "at");
}

// Includes a wrong clock: an old command may be unwanted by now.
bool is_recent(double asked_s) {
  return std::abs(now_s() - asked_s) <= start_lasts_s;
}

std::optional<HttpResponse> file_at(const std::string& path) {
  if (path == "/") return HttpResponse{200, "text/html; charset=utf-8", page_html};
  if (path == "/page.css") return HttpResponse{200, "text/css; charset=utf-8", page_css};
  if (path == "/welcome.js") return HttpResponse{200, "text/javascript; charset=utf-8", "location.replace(\"/\");\n"};
  if (path == "/page.js") return HttpResponse{200, "text/javascript; charset=utf-8", page_js};
  return std::nullopt;
}

// The number in ?after=; an image's numbers begin with 1.
long after_of(const HttpRequest& request) {
  const auto number = number_of(request, "after");
  return number && *number >= 0 && *number < 1e15 ? std::lround(*number) : 0;
}

std::string jpeg_of(const PageImage& image) {
  const auto bytes = encode_jpeg(draw_overlay(image.bgr, *image.rig, image.observations), jpeg_quality);
  return {bytes.begin(), bytes.end()};
}

using json = nlohmann::ordered_json;

json number(double value, double sigma) {
  return {{"value", value}, {"sigma", sigma}};
}

json joints_of(const Observation::Rcm& rcm) {
  const Eigen::Vector4d q = rcm.q.vector();
  json joints = json::object();
  for (std::size_t k = 0; k < JointVector::size; ++k) {
    const auto i = static_cast<Eigen::Index>(k);
    joints[std::string(JointVector::names[k])] = number(q[i], std::sqrt(rcm.covariance(i, i)));
  }
  return joints;
}

json features_of(const Features& features) {
  return {{"s_rad", features.s_rad},
          {"r_px", features.r_px ? json(*features.r_px) : json()},
          {"l_px", features.l_px},
          {"d_px", features.d_px}};
}

// As the page reads them; what is not known is null. `silent_s`: for so long no image has come, and what they were says
// nothing of now.
json json_of(const std::vector<Observation>& observations, std::optional<double> silent_s) {
  json instruments = json::array();
  for (const Observation& seen : observations) {
    if (silent_s) {
      instruments.push_back({{"name", seen.instrument}, {"status", fmt::format("no image for {:.0f} s", *silent_s)}});
      continue;
    }
    json one{{"name", seen.instrument}, {"status", to_string(seen.status)}};
    if (seen.status == Status::ok) {
      one["tau_rad"] = number(seen.tau_rad, seen.sigma_tau_rad);
      one["features"] = features_of(seen.features);
      if (seen.rcm) one["q"] = joints_of(*seen.rcm);
    }
    instruments.push_back(std::move(one));
  }
  return instruments;
}

json json_of(const PageLoop& loop) {
  const auto four = [](const std::optional<Eigen::Vector4d>& values, Eigen::Index i) {
    return values ? json((*values)[i]) : json();
  };
  json features = json::array();
  for (std::size_t k = 0; k < FeatureVector::size; ++k) {
    const auto i = static_cast<Eigen::Index>(k);
    features.push_back({{"name", FeatureVector::names[k]},
                        {"measured", four(loop.features, i)},
                        {"desired", four(loop.desired, i)},
                        {"error", four(loop.error, i)}});
  }
  return {{"time_s", loop.time_s},       {"delay_s", loop.delay_s}, {"limited", loop.limited},
          {"can_start", loop.can_start}, {"answer", loop.answer},   {"features", features}};
}

// Never throws for its text: what is no UTF-8 is replaced.
std::string text_of(const json& value) {
  return value.dump(-1, ' ', false, json::error_handler_t::replace);
}

}  // namespace

LivePage::LivePage(const PageConfig& config)
    : config_(config),
      token_(is_loopback(config.address, "--listen") ? "" : random_token()),
      access_(token_.empty(), token_) {
  server_ =
      std::make_unique<HttpServer>(config.address, config.port, "--web", config.limits,
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

long LivePage::show(PageImage image) {
  const auto age = std::chrono::duration_cast<Time::duration>(std::chrono::duration<double>(image.age_s));
  images_.put({std::move(image), ++shown_, std::chrono::steady_clock::now() - age});
  return shown_;
}

void LivePage::tell(const PageLoop& loop, const std::string& state) {
  if (events_->empty() || events_->front().state != state) {
    Events events{{loop.time_s, state}};
    events.insert(events.end(), events_->begin(),
                  events_->begin() + static_cast<long>(std::min(events_->size(), most_events - 1)));
    events_ = std::make_shared<const Events>(std::move(events));
  }
  loops_.put({loop, events_, std::chrono::steady_clock::now()});
}

// With the mutex held.
void LivePage::fetch() {
  if (auto image = images_.take()) newest_ = std::move(*image);
  if (auto told = loops_.take()) told_ = std::move(*told);
}

PageWishes LivePage::take_wishes() {
  PageWishes wishes;
  if (const double asked_s = start_s_.exchange(never); is_recent(asked_s))
    wishes.hold = false, wishes.start_age_s = std::max(0.0, now_s() - asked_s);
  if (hold_.exchange(false)) wishes.hold = true;  // of two between ticks, the one that holds
  wishes.stop = stop_;
  if (const auto wish = tips_.take()) {
    wishes.tip = wish->tip;
    wishes.tip->too_late = !is_recent(wish->asked_s);
  }
  return wishes;
}

std::optional<HttpResponse> LivePage::answer(const HttpRequest& request, bool last) {
  if (auto refusal = access_.refuse(request)) return refusal;
  if (request.method == "POST") return command(request);
  if (request.method != "GET") return plain(405, "GET and POST only");
  if (request.path == "/picture") return picture(request, last);
  if (request.path == "/state") return state();
  if (auto file = file_at(request.path)) return file;
  return plain(404, "there is no such page");
}

// The page requests the next image when it has one: none waits in a socket on a slow connection.
std::optional<HttpResponse> LivePage::picture(const HttpRequest& request, bool last) {
  const long after = after_of(request);
  std::unique_lock lock(mutex_);
  fetch();
  const auto drawn = drawn_;
  const auto now = std::chrono::steady_clock::now();
  const bool current = drawn && (drawn->number == newest_.number || now < drawn->done + recent);
  if (!current || drawn->number == after) {
    watched_until_ = now + watched;
    lock.unlock();
    changed_.notify_one();
    return last ? std::optional(HttpResponse{.status = 204}) : std::nullopt;
  }
  lock.unlock();
  return HttpResponse{200,
                      "image/jpeg",
                      drawn->jpeg,
                      {{"X-Number", std::to_string(drawn->number)},
                       {"X-Came-S", fmt::format("{:.4f}", seconds(drawn->came.time_since_epoch()))}}};
}

HttpResponse LivePage::command(const HttpRequest& request) {
  const std::string& path = request.path;
  if (path == "/stop") {
    stop_ = true;
    return plain(202, "the run ends");
  }
  if (config_.has_run_button && path == "/press") return press(request);
  if (config_.has_run_button && path == "/release") {
    released_s_ = now_s();
    run_button_.release();
    return plain(202, "released");
  }
  if (path == "/tip") return want_tip(request);
  if (path != "/hold" && path != "/start") return plain(404, "there is no such command");
  if (!config_.has_loop) return plain(403, "nothing that moves is commanded here");
  if (path == "/start") return start(request);
  hold_ = true;
  return plain(202, "accepted");
}

HttpResponse LivePage::start(const HttpRequest& request) {
  if (!config_.may_start) return plain(403, "lapservo runs without --enable-motion");
  const auto asked_s = time_of(request);
  if (!asked_s) return plain(400, "a start needs its time: ?at= now_s of /state");
  if (!is_recent(*asked_s)) return plain(409, "it came too late, nothing was started");
  start_s_ = *asked_s;
  return plain(202, "accepted");
}

HttpResponse LivePage::want_tip(const HttpRequest& request) {
  if (!config_.takes_tip_goals) return plain(403, "no goals of the tip are taken here");
  const auto u_px = number_of(request, "u"), v_px = number_of(request, "v"), asked_s = time_of(request),
             image = number_of(request, "image");
  if (!u_px || !v_px || !asked_s || !image)
    return plain(400,
                 "a goal needs its pixel, image and time: ?u=&v=&image= X-Number of /picture &at= now_s of /state");
  if (!is_recent(*asked_s)) return plain(409, "it came too late, the goal stays");
  {
    const std::lock_guard lock(mutex_);
    fetch();
    const cv::Mat& bgr = newest_.image.bgr;
    if (!(*image >= 1 && *image <= static_cast<double>(newest_.number))) return plain(400, "there is no such image");
    if (!(*u_px >= -0.5 && *u_px <= bgr.cols - 0.5 && *v_px >= -0.5 && *v_px <= bgr.rows - 0.5))
      return plain(400, "it lies outside of the image");
  }
  tips_.put({{{*u_px, *v_px}, static_cast<long>(*image)}, *asked_s});
  return plain(202, "accepted");
}

HttpResponse LivePage::press(const HttpRequest& request) {
  const auto pressed_s = time_of(request);
  if (!pressed_s) return plain(400, "a press needs its time: ?at= now_s of /state");
  const double now = now_s();
  if (std::abs(now - *pressed_s) > HeldButton::max_age_s || *pressed_s <= released_s_)
    return plain(409, "it came too late and does not count");
  run_button_.press(std::min(*pressed_s, now));
  return plain(202, "pressed");
}

bool LivePage::operator_present() {
  return run_button_.was_held(now_s());
}

HttpResponse LivePage::state() {
  json state{{"title", config_.title},
             {"has_loop", config_.has_loop},
             {"may_start", config_.may_start},
             {"has_run_button", config_.has_run_button},
             {"live", config_.live},
             {"ended", over_.load()},
             {"takes_tip_goals", config_.takes_tip_goals}};
  watched_ = true;
  const auto now = std::chrono::steady_clock::now();
  state["now_s"] = seconds(now.time_since_epoch());
  std::vector<Observation> observations;
  std::optional<double> silent_s;
  {
    const std::lock_guard lock(mutex_);
    fetch();
    observations = newest_.image.observations;
    if (config_.live && now - newest_.came > old) silent_s = seconds(now - newest_.came);
    state["images"] = newest_.number;
    state["loop"] = told_ ? json_of(told_->loop) : json();
    state["loop_age_s"] = told_ ? json(seconds(now - told_->when)) : json();
    state["events"] = json::array();
    if (told_)
      for (const Event& event : *told_->events)
        state["events"].push_back({{"time_s", event.time_s}, {"state", event.state}});
  }
  state["instruments"] = json_of(observations, silent_s);
  state["asked"] = hold_ ? "hold" : is_recent(start_s_) ? "start" : "";
  return {200, "application/json", text_of(state)};
}

// Nullptr where it can't be, for want of memory too: the next one, perhaps. With the mutex held, but while it draws.
std::shared_ptr<const LivePage::Drawn> LivePage::draw_newest(std::unique_lock<std::mutex>& lock) const {
  std::shared_ptr<Drawn> drawn;
  try {
    const Shown shown = newest_;
    lock.unlock();
    drawn = std::make_shared<Drawn>(Drawn{shown.number, shown.came, {}, jpeg_of(shown.image)});
    drawn->done = std::chrono::steady_clock::now();
  } catch (const std::exception&) {
  }
  if (!lock.owns_lock()) lock.lock();
  return drawn;
}

void LivePage::draw() {
  lower_priority();
  std::unique_lock lock(mutex_);
  while (!ended_) {
    fetch();
    if (std::chrono::steady_clock::now() >= watched_until_) {
      changed_.wait(lock);
      continue;
    }
    if (newest_.number == 0 || (drawn_ && drawn_->number == newest_.number)) {
      changed_.wait_for(lock, between_looks);  // so that the loop need not wake it
      continue;
    }
    watched_until_ = {};
    const auto begin = std::chrono::steady_clock::now();
    if (auto drawn = draw_newest(lock)) drawn_ = std::move(drawn);
    lock.unlock();
    server_->wake();
    std::this_thread::sleep_until(begin + between_drawings);
    lock.lock();
  }
}

}  // namespace lapservo::internal
