#!/usr/bin/env python3
"""The site as browsers of 1280 and 390 px meet it, from a server: test_site.py HTML_FOLDER [FOLDER for screenshots].

Each page without an error on the console, a request that fails or one to another site; nothing is cut off; blocks can be copied.
"""

import functools
import http.server
import json
import pathlib
import shutil
import sys
import tempfile
import threading

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "web"))

from test_page import Browser  # noqa: E402

TALLEST_PX = 20000  # at 1280 px


class Quiet(http.server.SimpleHTTPRequestHandler):
    def log_message(self, *_):
        pass


def see(browser, address, name, width, folder):
    browser.complaints.clear()
    browser.resize(width, 800)
    browser.call("Page.navigate", url=f"{address}/{name}")
    browser.wait_for(f"location.pathname === {json.dumps('/' + name)} && document.readyState === 'complete'")
    browser.value("new Promise((done) => setTimeout(done, 50))")
    assert not browser.complaints, f"{name} at {width} px: {browser.complaints}"
    elsewhere = browser.value("performance.getEntriesByType('resource').map(r => r.name)"
                              ".filter(n => !n.startsWith(location.origin) && !n.startsWith('data:')).join()")
    assert not elsewhere, f"{name} loads {elsewhere}"
    assert browser.value("document.documentElement.scrollWidth") <= width, f"{name} is wider than {width} px"
    if width > 1000:
        cut = browser.value("[...document.querySelectorAll('.table-wrapper')].filter(t => t.scrollWidth > t.clientWidth).length")
        assert cut == 0, f"{name}: {cut} tables are cut off at {width} px"
        height = browser.value("document.documentElement.scrollHeight")
        assert height < TALLEST_PX, f"{name} is {height} px tall"
    blocks, buttons = (browser.value(f"document.querySelectorAll('{what}').length") for what in ("div.highlight pre", "button.copybtn"))
    assert blocks == buttons, f"{name}: {blocks} blocks, {buttons} buttons that copy"
    if folder:
        browser.screenshot(pathlib.Path(folder) / f"{name.replace('/', '_')}_{width}.png")


def main():
    site = pathlib.Path(sys.argv[1])
    folder = sys.argv[2] if len(sys.argv) > 2 else None
    pages = sorted(str(path.relative_to(site)) for path in site.rglob("*.html"))
    assert len(pages) > 40 and "python_api.html" in pages, pages
    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), functools.partial(Quiet, directory=site))
    threading.Thread(target=server.serve_forever, daemon=True).start()
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as profile:
        browser = Browser(shutil.which("chromium"), profile)
        try:
            for name in pages:
                for width in (1280, 390):
                    see(browser, f"http://127.0.0.1:{server.server_port}", name, width, folder)
        finally:
            browser.close()
    print(f"{len(pages)} pages at 1280 and 390 px: no errors")


main()
