#pragma once

#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

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

}  // namespace lapservo::internal
