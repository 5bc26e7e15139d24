#include "web/live_page.h"

#include <chrono>
#include <memory>
#include <optional>
#include <thread>
#include <vector>

#include <gtest/gtest.h>

#include "lapservo/io/image_file.h"
#include "lapservo/testing/input_error.h"
#include "lapservo/testing/rigs.h"
#include "web/test_http.h"

namespace lapservo::internal::live_page_test {

using namespace lapservo::testing;

using Change = void (*)(PageConfig&);

PageConfig config_of_test(Change change = [](PageConfig&) {}) {
  PageConfig config;
  config.title = "test";
  config.port = 0;
  config.has_loop = true;
  config.limits.first_s = config.limits.head_s = 0.3;
  config.limits.patience_s = 0.2;
  config.limits.connections = config.limits.connections_per_address = 16;
  change(config);
  return config;
}

std::string body_of(const std::string& answer) {
  return answer.substr(answer.find("\r\n\r\n") + 4);
}

PageImage image_of(const Rig& rig, double brightness) {
  const cv::Mat bgr(rig.camera.height_px, rig.camera.width_px, CV_8UC3, cv::Scalar::all(brightness));
  Observation seen;
  seen.instrument = rig.instruments.front().name;
  return {bgr, std::make_shared<const Rig>(rig), {seen}, 0.01};
}

// A page that is served; get() and post() give the status.
struct Served : LivePage {
  explicit Served(Change change = [](PageConfig&) {}) : LivePage(config_of_test(change)) {}
  int get(const std::string& path, const std::string& headers = "") const {
    return http_status(http(port, "GET", path, headers));
  }
  int post(const std::string& path) const { return http_status(http_post(port, path)); }
  // The head of a request that other lines may follow.
  std::string question(const std::string& path) const {
    return fmt::format("GET {} HTTP/1.1\r\nHost: 127.0.0.1:{}\r\n", path, port);
  }
  std::string state() const { return http(port, "GET", "/state"); }
  bool tells(const std::string& part) const { return state().find(part) != std::string::npos; }
  // Like the page: requests again after a timeout.
  std::string newer_picture(int after) const {
    std::string answer;
    for (int i = 0; i < 100 && http_status(answer) != 200; ++i)
      answer = http(port, "GET", fmt::format("/picture?after={}", after));
    return answer;
  }
  const int port = std::stoi(url().substr(url().rfind(':') + 1));
};

TEST(LivePage, ShowsTheNewestImageToWhoeverWaits) {
  const Rig rig = testing::small_test_rig();
  EXPECT_EQ(Served().get("/picture"), 204);
  Served page;
  for (const double brightness : {10, 90, 200}) page.show(image_of(rig, brightness));
  const std::string answer = page.newer_picture(0);
  ASSERT_EQ(http_status(answer), 200);
  EXPECT_NE(answer.find("X-Number: 3\r\n"), std::string::npos) << answer.substr(0, 600);
  const std::string jpeg = body_of(answer);
  const cv::Mat shown =
      decode_image({reinterpret_cast<const std::uint8_t*>(jpeg.data()), jpeg.size()}, "the page's image");
  ASSERT_EQ(shown.size(), cv::Size(rig.camera.width_px, rig.camera.height_px));
  EXPECT_NEAR(shown.at<cv::Vec3b>(shown.rows / 2, shown.cols / 2)[1], 200, 3);
  EXPECT_EQ(page.get("/picture?after=3"), 204);
  std::thread later([&] {
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
    page.show(image_of(rig, 40));
  });
  EXPECT_NE(page.newer_picture(3).find("X-Number: 4\r\n"), std::string::npos);
  later.join();
}

TEST(LivePage, ServesItsFilesAndNothingElse) {
  Served page;
  const std::string html = http(page.port, "GET", "/");
  EXPECT_EQ(http_status(html), 200);
  EXPECT_NE(html.find("<script src=\"page.js\""), std::string::npos);
  EXPECT_NE(html.find("frame-ancestors 'none'"), std::string::npos);
  for (const char* path : {"/page.css", "/page.js", "/welcome.js", "/state"}) EXPECT_EQ(page.get(path), 200) << path;
  for (const char* path : {"/x", "/../etc/passwd", "//page.js", "/page.js/", "/hold"})
    EXPECT_EQ(page.get(path), 404) << path;
  EXPECT_EQ(http_status(http(page.port, "DELETE", "/state")), 405);
}

TEST(LivePage, KnowsItsViewersAndTellsThemTheEnd) {
  Served page;
  EXPECT_FALSE(page.was_watched());
  EXPECT_TRUE(page.tells("\"ended\":false"));
  EXPECT_TRUE(page.was_watched());
  page.end();
  EXPECT_TRUE(page.tells("\"ended\":true"));
}

TEST(LivePage, TellsWhatTheLoopDoes) {
  const Rig rig = testing::small_test_rig();
  Served page;
  page.show(image_of(rig, 10));
  PageLoop loop;
  loop.desired = Eigen::Vector4d(0.9, 400, 180, 100);
  loop.error = Eigen::Vector4d(0.001, NAN, 2, 3);
  page.tell(loop, "track");
  page.tell(loop, "hold: marker_lost");
  const std::string state = page.state();
  for (const char* part :
       {R"("state":"hold: marker_lost")", R"("state":"track")", R"("name":"PSM1","status":"no_marker")",
        R"("name":"r_px","measured":null,"desired":400.0,"error":null)", R"("may_start":false)"})
    EXPECT_NE(state.find(part), std::string::npos) << part << " in " << state;
}

TEST(LivePage, ForgetsWhatOldImagesShowed) {
  Served page;
  PageImage image = image_of(testing::small_test_rig(), 10);
  image.observations[0].status = Status::ok;
  image.age_s = 5.2;
  page.show(image);
  EXPECT_TRUE(page.tells(R"({"name":"PSM1","status":"no image for 5 s"})"));
  image.age_s = 0;
  page.show(image);
  EXPECT_TRUE(page.tells(R"("name":"PSM1","status":"ok")"));
}

TEST(LivePage, HoldsAlwaysAndStartsOnlyWhereMotionIsEnabled) {
  {
    Served page;
    EXPECT_EQ(page.post(start_path()), 403);
    EXPECT_FALSE(page.take_wishes().hold);
    EXPECT_EQ(page.post("/hold"), 202);
    EXPECT_EQ(page.take_wishes().hold, true);
    EXPECT_FALSE(page.take_wishes().hold);  // once
    EXPECT_EQ(page.post("/hold"), 202);
    EXPECT_EQ(page.post(start_path()), 403);
    EXPECT_EQ(page.take_wishes().hold, true);
    EXPECT_EQ(page.post("/stop"), 202);
    EXPECT_TRUE(page.take_wishes().stop);
    EXPECT_EQ(page.post("/explode"), 404);
  }
  {
    Served page([](PageConfig& config) { config.may_start = true; });
    EXPECT_EQ(page.post(start_path()), 202);
    EXPECT_EQ(page.take_wishes().hold, false);
    EXPECT_EQ(page.post("/hold"), 202);
    EXPECT_EQ(page.post(start_path()), 202);
    EXPECT_EQ(page.take_wishes().hold, true);  // of two in a tick
  }
  const Served loopless([](PageConfig& config) { config.may_start = true, config.has_loop = false; });
  EXPECT_EQ(loopless.post(start_path()), 403);
  EXPECT_EQ(loopless.post("/hold"), 403);
}

// The network or a stopped process may delay it: its sender does not expect it any more.
TEST(LivePage, StartsNothingLate) {
  Served page([](PageConfig& config) { config.may_start = true; });
  for (const std::string& path : {start_path(1.1), start_path(100), start_path(-100)})
    EXPECT_EQ(page.post(path), 409) << path;
  for (const char* path : {"/start", "/start?at=", "/start?at=now", "/start?at=nan", "/start?at=inf"})
    EXPECT_EQ(page.post(path), 400) << path;
  EXPECT_FALSE(page.take_wishes().hold);
  EXPECT_EQ(page.post(start_path(0.5)), 202);
  EXPECT_TRUE(page.tells(R"("asked":"start")"));
  std::this_thread::sleep_for(std::chrono::milliseconds(520));
  EXPECT_TRUE(page.tells(R"("asked":"")"));
  EXPECT_FALSE(page.take_wishes().hold);
  EXPECT_EQ(page.post(start_path(0.3)), 202);
  EXPECT_NEAR(page.take_wishes().start_age_s, 0.3, 0.2) << "a hold may have come in between";
  // A hold counts late too.
  EXPECT_EQ(page.post("/hold"), 202);
  std::this_thread::sleep_for(std::chrono::milliseconds(20));
  EXPECT_EQ(page.post(start_path(1.1)), 409);
  EXPECT_EQ(page.take_wishes().hold, true);
}

TEST(LivePage, TakesAPixelForTheTipWhereItMay) {
  const Rig rig = testing::small_test_rig();
  const auto path = [](const std::string& u, const std::string& v, double ago_s = 0, const std::string& image = "1") {
    return "/tip?u=" + u + "&v=" + v + "&image=" + image + "&" + start_path(ago_s).substr(7);
  };
  {
    Served page;
    page.show(image_of(rig, 90));
    EXPECT_EQ(page.post(path("3", "4")), 403);
    EXPECT_FALSE(page.take_wishes().tip);
  }
  Served page([](PageConfig& config) { config.takes_tip_goals = true; });
  EXPECT_EQ(page.post(path("3", "4")), 400) << "there is no image yet";
  page.show(image_of(rig, 90));
  EXPECT_EQ(page.post(path("3", "4")), 202);
  EXPECT_EQ(page.post(path("20.5", "10.25")), 202);
  const auto tip = page.take_wishes().tip;
  EXPECT_TRUE(tip && tip->at_px == Eigen::Vector2d(20.5, 10.25) && tip->image == 1 && !tip->too_late);
  EXPECT_FALSE(page.take_wishes().tip) << "once";
  EXPECT_EQ(page.post(path("3", "4", 1.1)), 409);
  const std::string beyond = std::to_string(rig.camera.width_px);
  for (const std::string& u : {std::string("-1"), beyond, std::string("nan"), std::string("")})
    EXPECT_EQ(page.post(path(u, "4")), 400) << u;
  EXPECT_EQ(page.post("/tip?u=3&v=4&image=1"), 400);
  for (const char* image : {"", "0", "2", "nan"}) EXPECT_EQ(page.post(path("3", "4", 0, image)), 400) << image;
  EXPECT_EQ(
      http_status(http(page.port, "POST", path("3", "4"), "Origin: http://evil.example\r\nContent-Length: 0\r\n")),
      403);
  EXPECT_FALSE(page.take_wishes().tip);
  EXPECT_EQ(page.post(path("3", "4", 0.9)), 202);
  std::this_thread::sleep_for(std::chrono::milliseconds(200));
  EXPECT_TRUE(page.take_wishes().tip.value().too_late) << "its sender does not expect it any more";
  PageLoop loop;
  loop.answer = "refused: tip_goal";
  page.tell(loop, "track");
  EXPECT_TRUE(page.tells(R"("answer":"refused: tip_goal")"));
}

// Without an answer in time, a pressed button is a released one.
TEST(LivePage, TheRunButtonIsPressedWhileThePageSaysSo) {
  EXPECT_EQ(Served().post(press_path()), 404);
  Served page([](PageConfig& config) { config.has_run_button = true; });
  const auto press = [&](double ago_s = 0) { return page.post(press_path(ago_s)); };
  EXPECT_FALSE(page.operator_present());
  EXPECT_EQ(press(), 202);
  EXPECT_TRUE(page.operator_present());
  EXPECT_FALSE(page.take_wishes().hold) << "it is no start by itself";
  std::this_thread::sleep_for(std::chrono::milliseconds(210));
  EXPECT_FALSE(page.operator_present());
  EXPECT_EQ(press(0.15), 202);  // on its way for so long
  EXPECT_TRUE(page.operator_present());
  std::this_thread::sleep_for(std::chrono::milliseconds(60));
  EXPECT_FALSE(page.operator_present());
  for (const double ago_s : {0.21, 5.0, -0.21}) EXPECT_EQ(press(ago_s), 409) << ago_s;
  EXPECT_FALSE(page.operator_present());
  for (const char* path : {"/press", "/press?at=", "/press?at=nan"}) EXPECT_EQ(page.post(path), 400) << path;
  // Released and pressed again between two queries; a press from before the release comes late.
  EXPECT_EQ(press(), 202);
  EXPECT_EQ(page.post("/release"), 202);
  EXPECT_EQ(press(0.1), 409);
  EXPECT_EQ(press(), 202);
  EXPECT_FALSE(page.operator_present());
  EXPECT_TRUE(page.operator_present());
}

TEST(LivePage, RefusesStrangers) {
  Served page([](PageConfig& config) { config.address = "0.0.0.0"; });
  const std::string url = page.url();
  const std::string token = url.substr(url.find("token=") + 6);
  for (const char* path : {"/", "/page.js", "/state", "/picture", "/?token=", "/?token=abc"})
    EXPECT_EQ(page.get(path), 401) << path;
  EXPECT_EQ(page.post("/stop"), 401);
  EXPECT_FALSE(page.take_wishes().stop);
  const std::string welcome = http(page.port, "GET", "/?token=" + token);
  EXPECT_EQ(http_status(welcome), 200);
  EXPECT_NE(welcome.find("<script src=\"welcome.js\">"), std::string::npos);
  const std::string cookie = fmt::format("Cookie: theme=dark; lapservo_token_{}={}\r\n", page.port, token);
  EXPECT_EQ(page.get("/state", cookie), 200);
}

TEST(LivePage, RefusesWhatIsMalformedOrTooLarge) {
  Served page;
  const std::string host = fmt::format("Host: 127.0.0.1:{0}\r\nOrigin: http://127.0.0.1:{0}\r\n", page.port);
  for (const std::string& text :
       {std::string("\r\n\r\n\r\n"), std::string("hello\r\n\r\n"), std::string(200, '\0'),
        "GET / HTTP/1.1\r\n" + host + "Host: evil\r\n\r\n", "GET /" + std::string(40000, 'a') + " HTTP/1.1\r\n\r\n",
        "GET / HTTP/1.1\r\n" + host + "X: " + std::string(40000, 'a') + "\r\n\r\n",
        "POST /hold HTTP/1.1\r\n" + host + "Content-Length: 99999999\r\n\r\n",
        "POST /hold HTTP/1.1\r\n" + host + "Content-Length: -1\r\n\r\n",
        "POST /hold HTTP/1.1\r\n" + host + "Transfer-Encoding: chunked\r\n\r\n0\r\n\r\n"}) {
    const RawConnection connection(page.port);
    connection.say(text);
    const int status = http_status(connection.hear());
    EXPECT_TRUE(status == 0 || (status >= 400 && status < 500)) << status << " to " << text.substr(0, 80);
  }
  EXPECT_FALSE(page.take_wishes().hold);
  EXPECT_EQ(page.get("/state"), 200);
}

TEST(LivePage, ForgetsWhoDoesNotFinishAsking) {
  Served page;
  const RawConnection slow(page.port);
  const auto begin = std::chrono::steady_clock::now();
  while (slow.say("x") && std::chrono::steady_clock::now() < begin + std::chrono::seconds(5))
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  EXPECT_LT(std::chrono::steady_clock::now() - begin, std::chrono::seconds(2));
}

using Crowd = std::vector<std::unique_ptr<RawConnection>>;

Crowd crowd_of(const Served& page, std::size_t count, const std::string& saying = "") {
  Crowd crowd;
  for (std::size_t i = 0; i < count; ++i) {
    crowd.push_back(std::make_unique<RawConnection>(page.port));
    crowd.back()->say(saying);
  }
  return crowd;
}

// By the limits as they are.
TEST(LivePage, WhoSaysNothingKeepsNobodyFromTheButtons) {
  for (const std::string& saying : {std::string(), std::string("GET / HTTP/1.1\r\nHost:")})
    for (const std::size_t count : {24u, 200u}) {
      Served page([](PageConfig& config) { config.limits = HttpLimits(); });
      const Crowd crowd = crowd_of(page, count, saying);
      const auto begin = std::chrono::steady_clock::now();
      EXPECT_EQ(page.get("/"), 200) << count;
      const auto shown = std::chrono::steady_clock::now();
      EXPECT_EQ(page.post("/hold"), 202) << count;
      EXPECT_EQ(page.take_wishes().hold, true);
      EXPECT_LT(shown - begin, std::chrono::milliseconds(200));
      EXPECT_LT(std::chrono::steady_clock::now() - shown, std::chrono::milliseconds(200));
    }
}

TEST(LivePage, NewConnectionsEndNoneThatHasRequested) {
  Served page([](PageConfig& config) { config.limits.connections_per_address = 4, config.limits.head_s = 60; });
  const std::string question = page.question("/state");
  Crowd asking;
  for (int i = 0; i < 4; ++i) {
    asking.push_back(std::move(crowd_of(page, 1, question + "\r\n").front()));
    EXPECT_EQ(http_status(asking.back()->hear_some()), 200);
  }
  const Crowd others = crowd_of(page, 20);
  EXPECT_EQ(others.front()->hear(), "");
  EXPECT_EQ(page.get("/state"), 0) << "more than the limit";
  for (const auto& one : asking) {
    one->say(question + "Connection: close\r\n\r\n");
    EXPECT_EQ(http_status(one->hear_some()), 200);
  }
}

TEST(LivePage, WaitsLongerForTheNextRequestThanForTheFirst) {
  EXPECT_LE(HttpLimits{}.first_s, 1);
  Served page([](PageConfig& config) { config.limits.first_s = 0.1, config.limits.head_s = 60; });
  const RawConnection silent(page.port), asking(page.port);
  const std::string question = page.question("/state");
  asking.say(question + "\r\n");
  const auto begin = std::chrono::steady_clock::now();
  EXPECT_EQ(silent.hear(), "");
  EXPECT_LT(std::chrono::steady_clock::now() - begin, std::chrono::seconds(10));
  std::this_thread::sleep_for(std::chrono::milliseconds(300));
  asking.say(question + "Connection: close\r\n\r\n");
  const std::string answers = asking.hear();
  EXPECT_NE(answers.find("HTTP/1.1 200", 1), std::string::npos) << answers;
}

TEST(LivePage, SaysWhereItCanNotListen) {
  Served page;
  PageConfig config = config_of_test();
  config.port = page.port;
  EXPECT_TRUE(testing::input_error([&] { const LivePage second(config); }).starts_with("--web: "));
}

TEST(LivePage, EndsWhileSomebodyWaits) {
  std::optional<RawConnection> viewer;
  std::chrono::steady_clock::time_point begin;
  {
    Served page([](PageConfig& config) { config.limits.patience_s = 60; });
    viewer.emplace(page.port);
    viewer->say(page.question("/picture") + "\r\n");
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
    begin = std::chrono::steady_clock::now();
  }
  viewer->hear();
  EXPECT_LT(std::chrono::steady_clock::now() - begin, std::chrono::seconds(10));
}

}  // namespace lapservo::internal::live_page_test
