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
/// --web and --listen.
void add_web_options(Command command, WebOptions& options);
/// The same, where the page is what the command is for.
void add_page_options(Command command, WebOptions& options);

/// The page of --web and `lapservo view`, whose address is printed.
class WebView {
 public:
  /// `config`: what the page is of; the rest is the options'. Throws InputError where it can't be served, and in a
  /// build without it.
  WebView(const WebOptions& options, internal::PageConfig config);

  // See internal::LivePage.
  long show(internal::PageImage image);
  void tell(const internal::PageLoop& loop, const std::string& state);
  void end();
  bool was_watched() const;
  internal::PageWishes wishes();
  bool operator_present();

 private:
  std::shared_ptr<internal::LivePage> page_;  // shared: a build without it has no destructor for it
};

}  // namespace lapservo::app
