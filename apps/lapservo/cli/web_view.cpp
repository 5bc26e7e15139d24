#include "apps/lapservo/cli/web_view.h"

#include <cstdio>

#include "lapservo/core/error.h"

namespace lapservo::app {
using namespace internal;

void WebOptions::check() const {
  if (!port && listen != WebOptions{}.listen)
    throw InputError("--listen", "is " + listen + " and there is no page, expected --web with it");
}

void add_web_options(Command command, WebOptions& options, bool page_only) {
  const Rule port = whole_between(0, 65535);
  if (page_only) options.port = 8080;
  command.add_option(
      "--web", options.port, page_only ? port : without_value("8080", port),
      page_only ? "The port of the page, else 8080; 0: any port that is free"
                : "Show it live on a page at this port for a browser on this computer; 0: any port that is free");
  command.add_option("--listen", options.listen,
                     "The page for others too, at this address of this computer (0.0.0.0: all); a token, printed once "
                     "with the page's address, is required then");
}

#ifdef LAPSERVO_WEB

std::unique_ptr<WebView> open_page(const WebOptions& options, PageConfig config) {
  config.port = options.port.value();
  config.address = options.listen;
  auto page = std::make_unique<WebView>(config);
  std::printf("page: %s\n", page->url().c_str());
  if (options.listen == "0.0.0.0" || options.listen == "::")
    std::printf("from elsewhere: with this computer's address in the place of %s\n", options.listen.c_str());
  std::fflush(stdout);
  return page;
}

#else

std::unique_ptr<WebView> open_page(const WebOptions&, PageConfig) {
  throw InputError(
      "--web", "needs a page, which this build lacks: it was built without libmicrohttpd-dev and nlohmann-json3-dev");
}

#endif

}  // namespace lapservo::app
