#include "web/http_server.h"

#include <algorithm>
#include <arpa/inet.h>
#include <cerrno>
#include <cstring>
#include <exception>
#include <microhttpd.h>
#include <new>
#include <sys/resource.h>
#include <sys/socket.h>
#include <unistd.h>
#include <utility>

#include "lapservo/core/error.h"
#include "lapservo/core/lower_case.h"

namespace lapservo::internal {
namespace {

// Forbids everything that no page needs, and all caching.
constexpr std::pair<const char*, const char*> always[] = {{"Content-Security-Policy",
                                                           "default-src 'none'; script-src 'self'; style-src 'self'; "
                                                           "img-src 'self' blob: data:; connect-src 'self'; base-uri "
                                                           "'none'; form-action 'none'; frame-ancestors 'none'"},
                                                          {"X-Content-Type-Options", "nosniff"},
                                                          {"X-Frame-Options", "DENY"},
                                                          {"Referrer-Policy", "no-referrer"},
                                                          {"Cross-Origin-Resource-Policy", "same-origin"},
                                                          {"Cache-Control", "no-store"}};

const HttpResponse failed = plain(500, "the server failed");

union Address {
  sockaddr any;
  sockaddr_in v4;
  sockaddr_in6 v6;
};

Address address_of(const std::string& text, int port, const std::string& option) {
  Address address{};
  if (::inet_pton(AF_INET, text.c_str(), &address.v4.sin_addr) == 1) {
    address.v4.sin_family = AF_INET;
    address.v4.sin_port = htons(static_cast<std::uint16_t>(port));
  } else if (::inet_pton(AF_INET6, text.c_str(), &address.v6.sin6_addr) == 1) {
    address.v6.sin6_family = AF_INET6;
    address.v6.sin6_port = htons(static_cast<std::uint16_t>(port));
  } else {
    throw InputError(option, "is " + text + ", expected an address of this computer");
  }
  return address;
}

MHD_Result add_header(void* headers, MHD_ValueKind, const char* key, const char* value) {
  static_cast<HttpRequest*>(headers)->headers.emplace(lower_case(key), value ? value : "");
  return MHD_YES;
}

template <auto values>
MHD_Result add_to(void* request, MHD_ValueKind, const char* key, const char* value) {
  (static_cast<HttpRequest*>(request)->*values).emplace(key, value ? value : "");
  return MHD_YES;
}

std::string bytes_of(const sockaddr& address) {
  const auto text = [](const auto& from) { return std::string(reinterpret_cast<const char*>(&from), sizeof from); };
  return address.sa_family == AF_INET6 ? text(reinterpret_cast<const sockaddr_in6&>(address).sin6_addr)
                                       : text(reinterpret_cast<const sockaddr_in&>(address).sin_addr);
}

bool has_body(const HttpRequest& request) {
  const auto length = request.header("content-length");
  return request.headers.count("transfer-encoding") > 0 ||
         (request.headers.count("content-length") > 0 && length != "0");
}

MHD_Result queue(MHD_Connection* connection, const HttpResponse& response) {
  MHD_Response* made = MHD_create_response_from_buffer(response.body.size(), const_cast<char*>(response.body.data()),
                                                       MHD_RESPMEM_MUST_COPY);
  if (!made) return MHD_NO;
  MHD_add_response_header(made, "Content-Type", response.type.c_str());
  for (const auto& [name, value] : always) MHD_add_response_header(made, name, value);
  for (const auto& [name, value] : response.headers) MHD_add_response_header(made, name.c_str(), value.c_str());
  if (response.status >= 400) MHD_add_response_header(made, "Connection", "close");
  const MHD_Result result = MHD_queue_response(connection, static_cast<unsigned>(response.status), made);
  MHD_destroy_response(made);
  return result;
}

}  // namespace

void lower_priority() {
  ::setpriority(PRIO_PROCESS, static_cast<id_t>(::gettid()), 10);
}

// A request and its answer.
struct HttpServer::Exchange {
  HttpRequest request;
  MHD_Connection* connection = nullptr;
  Peer* peer = nullptr;
  std::optional<Time> patience;  // since it began to wait
};

// As libmicrohttpd calls them, in its thread: no exception may leave.
struct HttpServer::Callbacks {
  static MHD_Result on_request(void* server, MHD_Connection* connection, const char* url, const char* method,
                               const char*, const char*, std::size_t* upload_size, void** exchange) {
    auto& self = *static_cast<HttpServer*>(server);
    try {
      if (!*exchange) {
        *exchange = begin(self, connection, url, method);
        return has_body(static_cast<Exchange*>(*exchange)->request)
                   ? queue(connection, plain(413, "a request is to have no body"))
                   : MHD_YES;
      }
      if (*upload_size > 0) return MHD_NO;
      return static_cast<MHD_Result>(self.answer(connection, *static_cast<Exchange*>(*exchange)));
    } catch (const std::exception&) {
      return MHD_NO;
    }
  }
  static void on_end(void* server, MHD_Connection*, void** exchange, MHD_RequestTerminationCode) {
    auto& self = *static_cast<HttpServer*>(server);
    const std::unique_ptr<Exchange> ended(static_cast<Exchange*>(std::exchange(*exchange, nullptr)));
    if (ended) self.set_deadline(*ended->peer, self.limits_.head_s);
  }
  static void on_connection(void* server, MHD_Connection* connection, void** peer,
                            MHD_ConnectionNotificationCode what) {
    auto& self = *static_cast<HttpServer*>(server);
    if (what == MHD_CONNECTION_NOTIFY_STARTED) {
      thread_local const bool lowered = (lower_priority(), true);
      (void)lowered;
      const int descriptor = MHD_get_connection_info(connection, MHD_CONNECTION_INFO_CONNECTION_FD)->connect_fd;
      try {
        const sockaddr& address = *MHD_get_connection_info(connection, MHD_CONNECTION_INFO_CLIENT_ADDRESS)->client_addr;
        auto made = std::make_unique<Peer>(Peer{descriptor, bytes_of(address)});
        self.set_deadline(*made, self.limits_.first_s);
        self.admit(*made);
        *peer = made.release();
      } catch (const std::exception&) {  // no memory
        ::shutdown(descriptor, SHUT_RDWR);
      }
    } else {
      const std::unique_ptr<Peer> ended(static_cast<Peer*>(*peer));
      const std::lock_guard lock(self.mutex_);
      std::erase(self.peers_, ended.get());
    }
  }

 private:
  static Exchange* begin(HttpServer& self, MHD_Connection* connection, const char* url, const char* method) {
    auto exchange = std::make_unique<Exchange>();
    exchange->connection = connection;
    exchange->peer =
        static_cast<Peer*>(MHD_get_connection_info(connection, MHD_CONNECTION_INFO_SOCKET_CONTEXT)->socket_context);
    if (!exchange->peer) throw std::bad_alloc();  // there was no memory for it
    HttpRequest& request = exchange->request;
    request.method = method;
    request.path = url;
    MHD_get_connection_values(connection, MHD_HEADER_KIND, add_header, &request);
    MHD_get_connection_values(connection, MHD_GET_ARGUMENT_KIND, add_to<&HttpRequest::query>, &request);
    MHD_get_connection_values(connection, MHD_COOKIE_KIND, add_to<&HttpRequest::cookies>, &request);
    exchange->peer->has_requested = true;
    self.set_deadline(*exchange->peer, self.limits_.answer_s);
    return exchange.release();
  }
};

HttpServer::HttpServer(const std::string& address, int port, const std::string& option, const HttpLimits& limits,
                       Handler handler)
    : limits_(limits), handler_(std::move(handler)) {
  const Address where = address_of(address, port, option);
  const unsigned v6 = where.any.sa_family == AF_INET6 ? MHD_USE_IPv6 : 0;
  daemon_ =
      MHD_start_daemon(MHD_USE_EPOLL_INTERNAL_THREAD | MHD_ALLOW_SUSPEND_RESUME | v6, static_cast<std::uint16_t>(port),
                       nullptr, nullptr, &Callbacks::on_request, this, MHD_OPTION_SOCK_ADDR, &where.any,  //
                       MHD_OPTION_CONNECTION_LIMIT, 2 * limits_.connections,                              //
                       MHD_OPTION_CONNECTION_MEMORY_LIMIT, limits_.request_bytes,                         //
                       MHD_OPTION_CONNECTION_TIMEOUT,
                       static_cast<unsigned>(std::max({limits_.first_s, limits_.head_s, limits_.answer_s})),  //
                       MHD_OPTION_STRICT_FOR_CLIENT, 1,                                                       //
                       MHD_OPTION_NOTIFY_COMPLETED, &Callbacks::on_end, this,                                 //
                       MHD_OPTION_NOTIFY_CONNECTION, &Callbacks::on_connection, this, MHD_OPTION_END);
  if (!daemon_)
    throw InputError(option, "is " + address + ", where port " + std::to_string(port) + " can't be listened at (" +
                                 std::strerror(errno) + "), expected another port or an address of this computer");
  port_ = MHD_get_daemon_info(daemon_, MHD_DAEMON_INFO_BIND_PORT)->port;
  time_ = std::thread([this] { watch_time(); });
}

HttpServer::~HttpServer() {
  {
    const std::lock_guard lock(mutex_);
    ended_ = true;
  }
  changed_.notify_all();
  time_.join();
  wake();
  MHD_stop_daemon(daemon_);
}

int HttpServer::answer(MHD_Connection* connection, Exchange& exchange) {
  while (true) {
    std::unique_lock lock(mutex_);
    const long wakes = wakes_;
    const bool ended = ended_;
    lock.unlock();
    const auto now = std::chrono::steady_clock::now();
    const bool last = ended || (exchange.patience && now >= *exchange.patience);
    std::optional<HttpResponse> response;
    try {
      response = handler_(exchange.request, last);
    } catch (const std::exception&) {
      response = failed;
    }
    if (!response && last) response = failed;
    if (response) return queue(connection, *response);
    lock.lock();
    if (wakes != wakes_ || ended_) continue;
    if (!exchange.patience)
      exchange.patience =
          now + std::chrono::duration_cast<Time::duration>(std::chrono::duration<double>(limits_.patience_s));
    waiting_.push_back(&exchange);
    MHD_suspend_connection(connection);
    return MHD_YES;
  }
}

void HttpServer::set_deadline(Peer& peer, double from_now_s) {
  const std::lock_guard lock(mutex_);
  peer.deadline = std::chrono::steady_clock::now() +
                  std::chrono::duration_cast<Time::duration>(std::chrono::duration<double>(from_now_s));
}

// A connection more than the limits allow is ended: the oldest without a request yet or, where there is none, the
// new one. The server forgets it soon, and until then has room for as many again.
void HttpServer::admit(Peer& peer) {
  const std::lock_guard lock(mutex_);
  peers_.push_back(&peer);
  const auto is_any = [](const Peer&) { return true; };
  const auto is_neighbour = [&](const Peer& other) { return other.address == peer.address; };
  if (!make_room(is_neighbour, limits_.connections_per_address) || !make_room(is_any, limits_.connections)) end(peer);
}

// With the mutex held; the last peer is the new one.
bool HttpServer::make_room(const std::function<bool(const Peer&)>& among, unsigned limit) {
  const auto counts = [&](const Peer* peer) { return !peer->is_ended && among(*peer); };
  if (std::count_if(peers_.begin(), peers_.end(), counts) <= limit) return true;
  const auto silent = std::find_if(peers_.begin(), peers_.end() - 1,
                                   [&](const Peer* peer) { return counts(peer) && !peer->has_requested; });
  if (silent == peers_.end() - 1) return false;
  end(**silent);
  return true;
}

// With the mutex held. The server sees that it has ended, and forgets it.
void HttpServer::end(Peer& peer) {
  peer.is_ended = true;
  ::shutdown(peer.descriptor, SHUT_RDWR);
}

// With the mutex held. Allocates nothing: those who call it could not say what failed.
void HttpServer::resume(const std::function<bool(const Exchange&)>& which) {
  const auto end = std::partition(waiting_.begin(), waiting_.end(), [&](const Exchange* one) { return !which(*one); });
  std::for_each(end, waiting_.end(), [](const Exchange* one) { MHD_resume_connection(one->connection); });
  waiting_.erase(end, waiting_.end());
}

void HttpServer::wake() {
  const std::lock_guard lock(mutex_);
  ++wakes_;
  resume([](const Exchange&) { return true; });
}

void HttpServer::watch_time() {
  lower_priority();
  std::unique_lock lock(mutex_);
  while (!ended_) {
    changed_.wait_for(lock, std::chrono::milliseconds(100));
    const auto now = std::chrono::steady_clock::now();
    resume([now](const Exchange& exchange) { return now >= *exchange.patience; });
    for (Peer* peer : peers_)
      if (now >= peer->deadline) end(*peer);
  }
}

}  // namespace lapservo::internal
