#include "apps/lapservo/cli/web_view.h"

#include <cstdio>
#include <utility>

#include "lapservo/core/error.h"

namespace lapservo::app {
using namespace internal;
namespace {

constexpr int highest_port = 65535;

void add_listen_option(Command command, WebOptions& options) {
  command.add_option("--listen", options.listen,
                     "The page for others too, at this address of this computer (0.0.0.0: all); a token, printed once "
                     "with the page's address, is required then");
}

}  // namespace

void WebOptions::check() const {
  if (!port && listen != WebOptions{}.listen)
    throw InputError("--listen", "is " + listen + " and there is no page, expected --web with it");
}

void add_web_options(Command command, WebOptions& options) {
  command
      .add_option("--web", options.port,
                  "Show it live on a page at this port for a browser on this computer; 0: any port that is free")
      .whole_number_between(0, highest_port)
      .without_value("8080");
  add_listen_option(command, options);
}

void add_page_options(Command command, WebOptions& options) {
  options.port = 8080;
  command.add_option("--web", options.port, "The port of the page, else 8080; 0: any port that is free")
      .whole_number_between(0, highest_port);
  add_listen_option(command, options);
}

#ifdef LAPSERVO_WEB

WebView::WebView(const WebOptions& options, PageConfig config) {
  config.port = options.port.value();
  config.address = options.listen;
  page_ = std::make_shared<LivePage>(config);
  std::printf("page: %s\n", page_->url().c_str());
  if (options.listen == "0.0.0.0" || options.listen == "::")
    std::printf("from elsewhere: with this computer's address in the place of %s\n", options.listen.c_str());
  std::fflush(stdout);
}

long WebView::show(PageImage image) {
  return page_->show(std::move(image));
}

void WebView::tell(const PageLoop& loop, const std::string& state) {
  page_->tell(loop, state);
}

void WebView::end() {
  page_->end();
}

bool WebView::was_watched() const {
  return page_->was_watched();
}

PageWishes WebView::wishes() {
  return page_->take_wishes();
}

bool WebView::operator_present() {
  return page_->operator_present();
}

#else

WebView::WebView(const WebOptions&, PageConfig) {
  throw InputError(
      "--web", "needs a page, which this build lacks: it was built without libmicrohttpd-dev and nlohmann-json3-dev");
}

long WebView::show(PageImage) {
  return 0;
}
void WebView::tell(const PageLoop&, const std::string&) {}
void WebView::end() {}
bool WebView::was_watched() const {
  return false;
}
PageWishes WebView::wishes() {
  return {};
}
bool WebView::operator_present() {
  return false;
}

#endif

}  // namespace lapservo::app
