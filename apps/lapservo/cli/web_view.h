#pragma once

#include <memory>
#include <optional>
#include <string>

#include "apps/lapservo/cli/command.h"
#include "web/live_page.h"

namespace lapservo::app {

/// Where the page is served, if it is.
struct WebOptions {
  std::optional<int> port;
  std::string listen = "127.0.0.1";

  /// Throws InputError for --listen without --web.
  void check() const;
};
/// --web and --listen. `page_only`: the page is what the command is for.
void add_web_options(Command command, WebOptions& options, bool page_only = false);

#ifdef LAPSERVO_WEB
using WebView = internal::LivePage;
#else
/// In a build without the page: never made.
struct WebView {
  long show(const internal::PageImage&) { return 0; }
  void tell(const internal::PageLoop&, const std::string&) {}
  void end() {}
  bool was_watched() const { return false; }
  internal::PageWishes take_wishes() { return {}; }
  bool operator_present() { return false; }
};
#endif

/// The page of --web and `lapservo view`, whose address is printed. `config`: what the page is of; the rest is the
/// options'. Throws InputError where it can't be served, and in a build without it.
std::unique_ptr<WebView> open_page(const WebOptions& options, internal::PageConfig config);

}  // namespace lapservo::app
