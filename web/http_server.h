#pragma once

#include <chrono>
#include <condition_variable>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <utility>
#include <vector>

struct MHD_Connection;
struct MHD_Daemon;

namespace lapservo::internal {

/// A request without its body: none that has one is taken.
struct HttpRequest {
  std::string method, path;
  std::multimap<std::string, std::string> headers;  ///< names in lower case
  std::map<std::string, std::string> query;         ///< ?name=value
  std::map<std::string, std::string> cookies{};

  /// Value of a header that is there once; nullopt otherwise.
  std::optional<std::string> header(const std::string& name) const {
    return headers.count(name) == 1 ? std::optional(headers.find(name)->second) : std::nullopt;
  }
};

struct HttpResponse {
  int status = 200;
  std::string type = "text/plain; charset=utf-8", body{};
  std::vector<std::pair<std::string, std::string>> headers{};
};

inline HttpResponse plain(int status, const std::string& text) {
  return {.status = status, .body = text + "\n"};
}

/// Limits on the cost of other programs' requests.
struct HttpLimits {
  unsigned connections = 48, connections_per_address = 24;  ///< who has requested nothing yet makes room
  std::size_t request_bytes = 16384;                        ///< request line and headers; a body is refused
  double first_s = 1;                                       ///< for a connection's first request to come
  double head_s = 5;                                        ///< for the next one's head, from the answer before on
  double answer_s = 20;                                     ///< for an answer to be fetched
  double patience_s = 1;  ///< a waiting request is answered at the latest after this time
};

/// HTTP/1.1 by libmicrohttpd, in one thread at low priority, and another that watches the time.
class HttpServer {
 public:
  /// The answer, or nullopt: not yet; called again at the next wake(), and once with `last` when its patience has
  /// ended. Called in the server's thread.
  using Handler = std::function<std::optional<HttpResponse>(const HttpRequest&, bool last)>;

  /// At an address of this computer; port 0: any that is free. Throws InputError, naming `option`, where it can't.
  HttpServer(const std::string& address, int port, const std::string& option, const HttpLimits& limits,
             Handler handler);
  ~HttpServer();

  int port() const { return port_; }
  /// Calls the handler again for waiting requests. From any thread.
  void wake();

 private:
  using Time = std::chrono::steady_clock::time_point;
  struct Peer {
    int descriptor = -1;
    std::string address;  ///< as bytes
    Time deadline{};
    bool is_ended = false;
    bool has_requested = false;  ///< known to the server's thread only
  };
  struct Exchange;
  struct Callbacks;

  int answer(MHD_Connection* connection, Exchange& exchange);
  void set_deadline(Peer& peer, double from_now_s);
  void admit(Peer& peer);
  static void end(Peer& peer);
  bool make_room(const std::function<bool(const Peer&)>& among, unsigned limit);
  void resume(const std::function<bool(const Exchange&)>& which);
  void watch_time();

  HttpLimits limits_;
  Handler handler_;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::vector<Peer*> peers_;        // in the order in which they came
  std::vector<Exchange*> waiting_;  // their connections are suspended
  long wakes_ = 0;
  bool ended_ = false;
  int port_ = 0;
  MHD_Daemon* daemon_ = nullptr;
  std::thread time_;  // last: it uses the others
};

/// The calling thread yields to the loop: a nice value of 10.
void lower_priority();

}  // namespace lapservo::internal
