#!/usr/bin/env python3
"""count_sizes.py: lines of sources without tests, and numbers in them that somebody chose: literals other than 0 to 8, 0.5 and 255; and all lines of
the C++ that only tests use. Fails where there are more than the limit, which only falls."""
import re
import subprocess
import sys
from pathlib import Path

# folder: lines, chosen numbers
LIMITS = {"lapservo/vision": (9395, 267)}
TESTS = ["*_test.cpp", "*/test_*.cpp", "*/test_*.h", "lapservo/testing/*", "acceptance/*.cpp", "acceptance/*.h", "fuzz/*.cpp", "fuzz/*.h"]
MOST_TEST_LINES = 36932

NOT_CODE = re.compile(r'//[^\n]*|/\*.*?\*/|"(?:\\.|[^"\\])*"|\'(?:\\.|[^\'\\])\'|^#[^\n]*', re.S | re.M)
NUMBER = re.compile(r"(?<![\w.])(?:\d[\d']*\.?\d*|\.\d+)(?:[eE][+-]?\d+)?[fFuUlL]*(?![\w.])")
USUAL = {float(i) for i in range(9)} | {0.5, 255.0}


def is_test(path: str) -> bool:
    return path.endswith("_test.cpp") or Path(path).name.startswith("test_")


def chosen_numbers(source: str) -> int:
    values = (float(match.rstrip("fFuUlL").replace("'", "")) for match in NUMBER.findall(NOT_CODE.sub(" ", source)))
    return sum(value not in USUAL for value in values)


def files(patterns: list[str]) -> list[str]:
    return subprocess.check_output(["git", "ls-files", *patterns], text=True).split()


def lines_of(sources: list[str]) -> int:
    return sum(source.count("\n") for source in sources)


def main() -> int:
    failed = False
    for folder, (most_lines, most_numbers) in LIMITS.items():
        sources = [Path(path).read_text() for path in files([f"{folder}/*.cpp", f"{folder}/*.h"]) if not is_test(path)]
        lines = lines_of(sources)
        numbers = sum(chosen_numbers(source) for source in sources)
        print(f"{folder}: {lines} lines (at most {most_lines}), {numbers} chosen numbers (at most {most_numbers})")
        failed |= lines > most_lines or numbers > most_numbers
    lines = lines_of([Path(path).read_text() for path in files(TESTS)])
    print(f"tests: {lines} lines (at most {MOST_TEST_LINES})")
    return failed or lines > MOST_TEST_LINES


if __name__ == "__main__":
    sys.exit(main())
