#pragma once

#include <array>
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <deque>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include <Eigen/Core>
#include <opencv2/core.hpp>

#include "lapservo/rig/rig.h"
#include "lapservo/vision/observation.h"
#include "web/access.h"
#include "web/http_server.h"

namespace lapservo::internal {

struct PageConfig {
  std::string title;                  ///< what runs, in a few words
  std::string address = "127.0.0.1";  ///< to listen at; beyond this computer's own a token is asked for
  int port = 8080;                    ///< 0: any that is free
  std::string option = "--web";       ///< in complaints of the port
  bool live = true;                   ///< what is old is no longer so; else a file's
  bool has_loop = false;              ///< a loop that can be held and started
  bool may_start = false;
  HttpLimits limits{};
};

/// An image and what was seen in it.
struct PageImage {
  cv::Mat bgr;                     ///< not changed by anybody afterwards
  std::shared_ptr<const Rig> rig;  ///< to draw with
  std::vector<Observation> observations;
  double age_s = 0;  ///< since the image came
};

/// What the loop does: s_rad, r_px, l_px, d_px.
struct PageLoop {
  double time_s = 0;  ///< since it began
  std::optional<Eigen::Vector4d> desired, features, error;
  double delay_s = 0;  ///< of its images
  bool limited = false;
};

/// What those before the page want.
struct PageWishes {
  std::optional<bool> hold;  ///< true: hold; false: start; the last one
  bool stop = false;         ///< end the run
};

/// The page for those without a screen on this computer. Those who tell it something never wait: of images it keeps the
/// newest, and draws and encodes it in a thread of its own at low priority, while somebody watches.
class LivePage {
 public:
  /// Throws InputError when it can't listen there.
  explicit LivePage(const PageConfig& config);
  ~LivePage();
  LivePage(const LivePage&) = delete;
  LivePage& operator=(const LivePage&) = delete;

  /// To be opened in a browser, with the token.
  std::string url() const;

  // By the loop's thread. What comes while the page reads is dropped.
  void show(PageImage image);
  /// `state`: the loop's, in words.
  void tell(const PageLoop& loop, const std::string& state);
  PageWishes take_wishes();

 private:
  using Time = std::chrono::steady_clock::time_point;
  struct Waiting {
    PageImage image;
    Time came;  // the image, to this computer
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
  enum class Wish { none, hold, start };

  std::optional<HttpResponse> answer(const HttpRequest& request, bool last);
  std::optional<HttpResponse> picture(const HttpRequest& request, bool last);
  HttpResponse command(const std::string& path);
  HttpResponse state();
  void draw();

  PageConfig config_;
  std::string token_;
  Access access_;

  mutable std::mutex mutex_;
  std::condition_variable changed_;
  Waiting newest_;
  long number_ = 0;  // of images that were shown
  bool ended_ = false;
  std::shared_ptr<const Drawn> drawn_;
  std::optional<PageLoop> loop_;
  std::deque<Event> events_;  // the newest first
  Time told_;
  std::vector<Event> untold_;  // this and state_: the loop's thread's only
  std::string state_;
  std::atomic<bool> watched_ = false;  // somebody waits for a newer image than drawn_
  std::atomic<Wish> wish_ = Wish::none;
  std::atomic<bool> stop_ = false;
  std::unique_ptr<HttpServer> server_;
  std::thread thread_;  // last: it uses the others
};

}  // namespace lapservo::internal
