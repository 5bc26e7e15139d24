#!/usr/bin/env python3
"""check_links.py HTML_FOLDER|- CHECKOUT: links of a site within itself, to pages and to places in them, and relative links of the
checkout's Markdown files. Requests nothing from the network."""

import html.parser
import pathlib
import re
import sys
import urllib.parse


class Page(html.parser.HTMLParser):
    def __init__(self, text):
        super().__init__()
        self.links, self.places = [], set()
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        for name, value in attributes:
            if name in ("href", "src") and value:
                self.links.append(value)
            elif name == "id" or (tag == "a" and name == "name"):
                self.places.add(value)


def is_elsewhere(link):
    return bool(urllib.parse.urlparse(link).scheme) or link.startswith("//")


def dead_links_of_site(folder):
    pages = {path.resolve(): Page(path.read_text()) for path in folder.rglob("*.html")}
    for path, page in pages.items():
        for link in page.links:
            if is_elsewhere(link):
                continue
            target, _, place = urllib.parse.unquote(link).partition("#")
            file = (path.parent / target.partition("?")[0]).resolve() if target else path
            if not file.is_file():
                yield f"{path.relative_to(folder.resolve())}: {link}: no such file"
            elif place and file in pages and place not in pages[file].places:
                yield f"{path.relative_to(folder.resolve())}: {link}: no such place"


def dead_links_of_checkout(folder):
    skipped = re.compile(r"(^|/)(build[^/]*|\.git|demo)/")
    for path in sorted(folder.rglob("*.md")):
        if skipped.search(str(path.relative_to(folder))):
            continue
        text = re.sub(r"^```.*?^```", "", path.read_text(), flags=re.DOTALL | re.MULTILINE)
        for link in re.findall(r"\]\(([^)\s]+)\)", re.sub(r"`[^`\n]*`", "", text)):
            target = link.partition("#")[0]
            if target and not is_elsewhere(link) and not (path.parent / target).exists():
                yield f"{path.relative_to(folder)}: {link}: no such file"


def main():
    site, checkout = sys.argv[1], pathlib.Path(sys.argv[2])
    dead = [] if site == "-" else list(dead_links_of_site(pathlib.Path(site)))
    dead += dead_links_of_checkout(checkout)
    print("\n".join(dead))
    sys.exit(1 if dead else 0)


main()
