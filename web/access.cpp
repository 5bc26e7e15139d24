#include "web/access.h"

#include <arpa/inet.h>
#include <array>
#include <cstdint>
#include <sys/random.h>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "lapservo/core/error.h"
#include "lapservo/core/lower_case.h"

namespace lapservo::internal {
namespace {

// Goes on to / by itself, not by a redirection: of one that began at another site's link, browsers keep a strict cookie
// back.
constexpr const char* welcome_html = R"(<!doctype html>
<html lang="en">
<meta charset="utf-8">
<title>lapservo</title>
<link rel="icon" href="data:,">
<script src="welcome.js"></script>
<p><a href="/">lapservo</a></p>
</html>
)";

// "localhost", "192.0.2.1" or "::1" of a Host header; empty for what is none.
std::string name_in(const std::string& host) {
  const bool bracketed = host.starts_with('[');
  const std::size_t end = bracketed ? host.find(']') : host.find(':');
  std::string rest = end == std::string::npos ? "" : host.substr(end + (bracketed ? 1 : 0));
  if (bracketed && end == std::string::npos) return {};
  if (!rest.empty() && (rest.size() < 2 || rest.size() > 6 || rest.front() != ':' ||
                        rest.find_first_not_of("0123456789", 1) != std::string::npos))
    return {};
  return lower_case(bracketed ? host.substr(1, end - 1) : host.substr(0, end));
}

// Browsers send a host's cookies to all its ports: without the port, another page's token would replace this one's.
std::string cookie_at(const std::string& host) {
  const std::size_t colon = host.rfind(':');
  const bool has_port = colon != std::string::npos && colon + 1 < host.size() && host.back() != ']';
  return "lapservo_token_" + (has_port ? host.substr(colon + 1) : "80");
}

// A link on another site or in a mail that was followed: what it shows, that site can't read or frame.
bool follows_a_link(const HttpRequest& request) {
  return request.method == "GET" && request.path == "/" && request.header("sec-fetch-mode") == "navigate";
}

bool is_address(const std::string& text) {
  std::array<unsigned char, sizeof(in6_addr)> address{};
  return ::inet_pton(AF_INET, text.c_str(), address.data()) == 1 ||
         ::inet_pton(AF_INET6, text.c_str(), address.data()) == 1;
}

}  // namespace

std::string random_token() {
  std::array<unsigned char, 32> bytes{};
  if (::getrandom(bytes.data(), bytes.size(), 0) != static_cast<ssize_t>(bytes.size()))
    throw InputError("--listen", "needs a token, and the system gives no random numbers");
  return fmt::format("{:02x}", fmt::join(bytes, ""));
}

bool equal_in_constant_time(std::string_view a, std::string_view b) {
  if (a.size() != b.size()) return false;
  volatile unsigned char difference = 0;
  for (std::size_t i = 0; i < a.size(); ++i) difference = difference | static_cast<unsigned char>(a[i] ^ b[i]);
  return difference == 0;
}

bool is_loopback(const std::string& address, const std::string& option) {
  in_addr v4{};
  in6_addr v6{};
  if (::inet_pton(AF_INET, address.c_str(), &v4) == 1) return (ntohl(v4.s_addr) >> 24) == 127;
  if (::inet_pton(AF_INET6, address.c_str(), &v6) == 1) return IN6_IS_ADDR_LOOPBACK(&v6);
  throw InputError(option, (address.empty() ? "is empty" : "is " + address) +
                               ", expected an address of this computer, for example 192.168.1.20, or 0.0.0.0 for all");
}

bool Access::is_own_host(const std::string& host) const {
  const std::string name = name_in(host);
  if (name == "localhost") return true;
  return is_address(name) && (!loopback_ || is_loopback(name, "Host"));
}

std::optional<HttpResponse> Access::ask_for_token(const HttpRequest& request) const {
  if (token_.empty()) return std::nullopt;
  const std::string cookie = cookie_at(request.header("host").value());
  const auto kept = request.cookies.find(cookie);
  if (kept != request.cookies.end() && equal_in_constant_time(kept->second, token_)) return std::nullopt;
  const auto given = request.query.find("token");
  if (request.method != "GET" || request.path != "/" || given == request.query.end() ||
      !equal_in_constant_time(given->second, token_))
    return plain(401, "open the address with the token that lapservo printed");
  return HttpResponse{200,
                      "text/html; charset=utf-8",
                      welcome_html,
                      {{"Set-Cookie", fmt::format("{}={}; HttpOnly; SameSite=Strict; Path=/", cookie, token_)}}};
}

std::optional<HttpResponse> Access::refuse(const HttpRequest& request) const {
  const auto host = request.header("host");
  if (!host || !is_own_host(*host)) return plain(403, "the host is to be an address or localhost");
  const auto count = request.headers.count("origin");
  if (count > 0 && request.header("origin") != "http://" + *host)
    return plain(403, "a page of another site sends this");
  if (request.method == "POST" && count == 0) return plain(403, "a POST is to have its Origin");
  const auto site = request.header("sec-fetch-site");
  if (site && *site != "same-origin" && *site != "none" && !follows_a_link(request))
    return plain(403, "a page of another site sends this");
  return ask_for_token(request);
}

}  // namespace lapservo::internal
