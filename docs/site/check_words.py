#!/usr/bin/env python3
"""check_words.py: removed words (docs/glossary.md has the terms to use instead) in the pages for users and in comments, docstrings and
messages of the sources. Not read: code in pages, names in backticks and targets of links."""
import io
import re
import subprocess
import sys
import tokenize
from pathlib import Path

WORDS = re.compile(
    r"\b(tells?|told|asks|asked|believes?|believed|doubts?|doubted|judges?|judged|suspicious|leash|pictures?|(?<!-)set-points?|inks? aside"
    r"|prints? (that|which) (is|are) off|nothing was chosen|even light|gloss|no longer|honest\w*)\b", re.I)
# Of sentences, cells and headings.
BEGINNINGS = re.compile(r"(^|[.!?] |\| |#+ |\*\*|^ *- )(What|Of) ")


def prose_of_page(text: str) -> list[tuple[int, str]]:
    """Lines with their numbers, without code."""
    lines, code = [], False
    for number, line in enumerate(text.splitlines(), 1):
        if re.match(" *```", line):
            code = not code
        elif not code and not re.match(r" {4}[^-*0-9 ]", line):
            lines.append((number, re.sub(r"\]\([^)]*\)", "]", line)))
    return lines


def comments_of_c(text: str) -> list[tuple[int, str]]:
    """Comments, consecutive lines of them as one, and string literals that have a space."""
    found: list[tuple[int, str]] = []
    last = -1  # the line of the comment before
    token = re.compile(r'"(?:[^"\\\n]|\\.)*"|\'(?:[^\'\\\n]|\\.)\'|//[/!]?<?(.*)')
    for number, line in enumerate(text.splitlines(), 1):
        if line.startswith("#include"):
            continue
        for match in token.finditer(line):
            if match[1] is None:
                if " " in match[0].strip('" '):
                    found.append((number, match[0].strip('"')))
            elif last == number - 1 and not line[: match.start()].strip():
                found[-1] = (found[-1][0], found[-1][1] + " " + match[1].strip())
                last = number
            else:
                found.append((number, match[1].strip()))
                last = number
    return found


def comments_of_python(text: str) -> list[tuple[int, str]]:
    tokens = tokenize.generate_tokens(io.StringIO(text).readline)
    return [(token.start[0], token.string.strip("#\"' ")) for token in tokens
            if token.type == tokenize.COMMENT or (token.type == tokenize.STRING and " " in token.string)]


def main() -> int:
    files = subprocess.run(["git", "ls-files"], capture_output=True, text=True, check=True).stdout.split()
    hits = []
    for name in files:
        path = Path(name)
        if path.suffix == ".md" and (len(path.parts) == 1 or path.parts[0] == "docs"):
            prose = prose_of_page(path.read_text())
        elif path.suffix in {".cpp", ".h", ".js"}:
            prose = comments_of_c(path.read_text())
        elif path.suffix == ".py" and path != Path("docs/site/check_words.py"):
            prose = comments_of_python(path.read_text())
        else:
            continue
        for number, text in prose:
            text = re.sub(r"`[^`]*`|/picture\b|'picture'|lapservo\.Picture", "`", text)  # names, too
            found = WORDS.search(text) or BEGINNINGS.search(text)
            if found:
                hits.append(f"{name}:{number}: {found[0].strip()}: {text}")
    print("\n".join(hits), file=sys.stderr)
    if hits:
        print("check_words: use the terms of docs/glossary.md", file=sys.stderr)
    return 1 if hits else 0


if __name__ == "__main__":
    sys.exit(main())
