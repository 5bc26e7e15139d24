#pragma once

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include <Eigen/Core>
#include <opencv2/core.hpp>

#include "lapservo/rig/rig.h"
#include "lapservo/robot/held_button.h"
#include "lapservo/vision/observation.h"
#include "web/access.h"
#include "web/http_server.h"

namespace lapservo::internal {

/// Holds the newest of what was put in. Neither who puts nor who takes ever waits for the other.
template <typename T>
class Mailbox {
 public:
  Mailbox() = default;
  ~Mailbox() { take(); }
  Mailbox(const Mailbox&) = delete;
  Mailbox& operator=(const Mailbox&) = delete;

  void put(T value) {
    const auto before = exchange(std::make_unique<T>(std::move(value)));  // and ends here
  }
  /// Nullptr where nothing came since the last call.
  std::unique_ptr<T> take() { return exchange(nullptr); }

 private:
  std::unique_ptr<T> exchange(std::unique_ptr<T> value) {
    return std::unique_ptr<T>(newest_.exchange(value.release()));
  }

  std::atomic<T*> newest_ = nullptr;
};

struct PageConfig {
  std::string title;                  ///< what runs, in a few words
  std::string address = "127.0.0.1";  ///< to listen at; beyond this computer's own a token is required
  int port = 8080;                    ///< 0: any that is free
  bool live = true;                   ///< images get old; a file's do not
  bool has_loop = false;              ///< a loop that can be held and started
  bool may_start = false;
  bool has_run_button = false;   ///< see operator_present()
  bool takes_tip_goals = false;  ///< a pixel of the image may be named for the tip to go to
  HttpLimits limits{};
};

/// An image and what was seen in it.
struct PageImage {
  cv::Mat bgr;                     ///< not changed by anybody afterwards
  std::shared_ptr<const Rig> rig;  ///< to draw with
  std::vector<Observation> observations;
  double age_s = 0;  ///< since the image came
};

/// The loop's state: s_rad, r_px, l_px, d_px.
struct PageLoop {
  double time_s = 0;  ///< since it began
  std::optional<Eigen::Vector4d> desired, features, error;
  double delay_s = 0;  ///< of its images
  bool limited = false;
  bool can_start = true;  ///< Supervisor::can_start()
  std::string answer;     ///< in words, to the last goal of the tip
};

/// The commands of the page's users.
struct PageWishes {
  /// Where in an image the tip is wanted.
  struct Tip {
    Eigen::Vector2d at_px;
    long image = 0;         ///< its number by LivePage::show()
    bool too_late = false;  ///< not taken within a second: void, its sender does not expect motion any more
  };
  std::optional<bool> hold;  ///< true: hold; false: start; the last one
  double start_age_s = 0;    ///< since that start was requested: a hold may have come before it
  bool stop = false;         ///< end the run
  std::optional<Tip> tip;
};

/// The page for users without a screen on this computer. Its inputs never wait: it keeps the newest image only, and
/// draws and encodes it in a thread of its own at low priority, while somebody watches.
class LivePage {
 public:
  /// Throws InputError when it can't listen there.
  explicit LivePage(const PageConfig& config);
  ~LivePage();

  /// To be opened in a browser, with the token.
  std::string url() const;

  // By the loop's thread.
  /// The image's number, from 1 on.
  long show(PageImage image);
  /// `state`: the loop's, in words.
  void tell(const PageLoop& loop, const std::string& state);
  /// Nothing more comes: the page shows the last, without buttons.
  void end() { over_ = true; }
  /// Whether a browser has shown the page.
  bool was_watched() const { return watched_; }
  /// The commands since the last call. A start that is not taken within a second is void: its sender does not expect
  /// motion any more.
  PageWishes take_wishes();
  /// Whether somebody pressed the page's run button throughout since the last call. A press that
  /// the network kept back for longer than HeldButton::max_age_s does not count.
  bool operator_present();

 private:
  using Time = std::chrono::steady_clock::time_point;
  static constexpr double never = -1e9;
  struct Shown {
    PageImage image;
    long number = 0;  ///< from 1
    Time came;        ///< to this computer
  };
  struct Drawn {
    long number = 0;
    Time came, done;
    std::string jpeg;
  };
  struct Event {
    double time_s = 0;
    std::string state;
  };
  using Events = std::vector<Event>;  ///< the newest first
  struct Told {
    PageLoop loop;
    std::shared_ptr<const Events> events;
    Time when;
  };

  std::optional<HttpResponse> answer(const HttpRequest& request, bool last);
  std::optional<HttpResponse> picture(const HttpRequest& request, bool last);
  HttpResponse command(const HttpRequest& request);
  HttpResponse start(const HttpRequest& request);
  HttpResponse press(const HttpRequest& request);
  HttpResponse want_tip(const HttpRequest& request);
  HttpResponse state();
  void draw();
  std::shared_ptr<const Drawn> draw_newest(std::unique_lock<std::mutex>& lock) const;
  void fetch();

  PageConfig config_;
  std::string token_;
  Access access_;

  // The loop's thread's only.
  long shown_ = 0;
  std::shared_ptr<const Events> events_ = std::make_shared<const Events>();

  Mailbox<Shown> images_;
  Mailbox<Told> loops_;
  std::atomic<bool> hold_ = false, stop_ = false, over_ = false, watched_ = false;
  std::atomic<double> start_s_ = never;  ///< when it was requested
  struct TipWish {
    PageWishes::Tip tip;
    double asked_s = never;
  };
  Mailbox<TipWish> tips_;

  HeldButton run_button_;

  // The page's threads' only.
  std::mutex mutex_;
  std::condition_variable changed_;
  bool ended_ = false;
  Time watched_until_;  // somebody waits for a newer image than drawn_
  Shown newest_;
  std::optional<Told> told_;
  std::shared_ptr<const Drawn> drawn_;
  double released_s_ = never;
  std::unique_ptr<HttpServer> server_;
  std::thread thread_;  // last: it uses the others
};

}  // namespace lapservo::internal
