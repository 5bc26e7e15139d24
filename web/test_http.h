#pragma once

#include <arpa/inet.h>
#include <chrono>
#include <cstdint>
#include <stdexcept>
#include <string>
#include <sys/socket.h>

#include <fmt/format.h>

#include "lapservo/core/file_descriptor.h"

namespace lapservo::testing {

/// A connection to a server on this computer that says what no browser would.
class RawConnection {
 public:
  explicit RawConnection(int port) : socket_(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_port = htons(static_cast<std::uint16_t>(port));
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    const timeval patience{20, 0};
    ::setsockopt(socket_.number(), SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
    if (::connect(socket_.number(), reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0)
      throw std::runtime_error("no server at port " + std::to_string(port));
  }

  bool say(const std::string& text) const {
    return ::send(socket_.number(), text.data(), text.size(), MSG_NOSIGNAL) == static_cast<ssize_t>(text.size());
  }
  /// The beginning of what comes.
  std::string hear_some() const {
    char part[4096];
    const ssize_t n = ::recv(socket_.number(), part, sizeof part, 0);
    return {part, static_cast<std::size_t>(n > 0 ? n : 0)};
  }
  /// All that comes until the server ends the connection.
  std::string hear() const {
    std::string text;
    char part[4096];
    for (ssize_t n = 0; (n = ::recv(socket_.number(), part, sizeof part, 0)) > 0;)
      text.append(part, static_cast<std::size_t>(n));
    return text;
  }

 private:
  internal::FileDescriptor socket_;
};

/// The whole answer; `headers`: whole lines, with Host unless it is there.
inline std::string http(int port, const std::string& method, const std::string& path, std::string headers = "") {
  if (headers.find("Host:") == std::string::npos) headers += fmt::format("Host: 127.0.0.1:{}\r\n", port);
  const RawConnection connection(port);
  connection.say(fmt::format("{} {} HTTP/1.1\r\n{}Connection: close\r\n\r\n", method, path, headers));
  return connection.hear();
}

/// As the page's own buttons.
inline std::string http_post(int port, const std::string& path, const std::string& headers = "") {
  return http(port, "POST", path, headers + fmt::format("Origin: http://127.0.0.1:{}\r\nContent-Length: 0\r\n", port));
}

/// Requests for http_post(); `ago_s`: since the page sent it.
inline std::string path_at(const std::string& path, double ago_s) {
  const std::chrono::duration<double> now = std::chrono::steady_clock::now().time_since_epoch();
  return fmt::format("{}?at={:.6f}", path, now.count() - ago_s);
}
inline std::string start_path(double ago_s = 0) {
  return path_at("/start", ago_s);
}
inline std::string press_path(double ago_s = 0) {
  return path_at("/press", ago_s);
}

/// 0 of what is no answer.
inline int http_status(const std::string& answer) {
  return answer.starts_with("HTTP/1.1 ") ? std::stoi(answer.substr(9, 3)) : 0;
}

}  // namespace lapservo::testing
