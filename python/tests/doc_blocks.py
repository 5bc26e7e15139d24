"""The blocks of README.md, CONTRIBUTING.md and docs/."""

import re

from conftest import SOURCE

PAGES = [SOURCE / "README.md", SOURCE / "CONTRIBUTING.md", *sorted((SOURCE / "docs").glob("*.md"))]


class Block:
    def __init__(self, page, line, language):
        self.page, self.language, self.text = page, language, ""
        self.where = f"{page.name}:{line}"

    def commands(self):
        return [line for line in self.text.replace("\\\n", "").splitlines() if line.strip()]


def blocks_of(page):
    found, block = [], None
    for number, line in enumerate(page.read_text().splitlines(), 1):
        if not re.match(r"\s*(```|~~~)", line):
            if block:
                block.text += line + "\n"
        elif block:
            found.append(block)
            block = None
        else:
            block = Block(page, number, line.strip()[3:].strip())
    assert not block, f"{block.where}: has no end"
    return found


BLOCKS = [block for page in PAGES for block in blocks_of(page)]
