#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "web/http_server.h"

namespace lapservo::internal {

/// 32 bytes of the kernel's randomness in hexadecimal. Throws InputError where there is none.
std::string random_token();

/// In a time that depends on the lengths only.
bool equal_in_constant_time(std::string_view a, std::string_view b);

/// Whether an address (not a name) means this computer only. Throws InputError, naming `option`, for what is none.
bool is_loopback(const std::string& address, const std::string& option);

/// Who may ask what. Against pages of other sites, which a browser lets send requests here: Host must be an address or
/// localhost (a name may be rebound by DNS), and Origin, which browsers send with every POST, this server's own.
/// Against strangers: the token, where there is one.
class Access {
 public:
  /// `token`: empty for a server that only this computer reaches.
  Access(bool loopback, std::string token) : loopback_(loopback), token_(std::move(token)) {}

  /// The refusal of a request; nullopt: it may be answered. A request of / with ?token=... gets the token as a cookie,
  /// and a page that continues to / by welcome.js.
  std::optional<HttpResponse> refuse(const HttpRequest& request) const;

 private:
  bool is_own_host(const std::string& host) const;
  std::optional<HttpResponse> ask_for_token(const HttpRequest& request) const;

  bool loopback_;
  std::string token_;
};

}  // namespace lapservo::internal
