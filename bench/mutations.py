"""mutations.py: which tests notice wrong code?

mutations.py run TABLE [--count N] [--seed S] [--minutes M]
    makes N seeded mutations of .cpp files without tests, folders by their sizes, and writes to TABLE (JSON), which it continues, which tests of the
    module, and of those that use it directly, fail then; without those of acceptance/, and those that fail or last long without a mutation.
mutations.py lost TABLE
    which of the mutations caught in TABLE no test that the tree still has caught.
mutations.py again TABLE
    makes these once more, with the tests of today, and says which of them nothing catches.

Run it in the source folder, whose build/ has the test programs to run (cmake --preset release). Edit no file there meanwhile.
"""
import argparse
import json
import os
import random
import re
import signal
import subprocess
import time
from pathlib import Path

FOLDERS = ["lapservo", "recordings", "transports", "web"]
SLOW_S = 4
BUILD_S, TESTS_S = 400, 120  # a run of tests that lasts longer hangs
OPPOSITES = {"+": "-", "-": "+", "*": "/", "/": "*", "<": ">=", ">=": "<", ">": "<=", "<=": ">", "==": "!=", "!=": "==", "&&": "||", "||": "&&"}
NOT_CODE = re.compile(r'//[^\n]*|/\*.*?\*/|"(?:\\.|[^"\\\n])*"|\'(?:\\.|[^\'\\\n])\'|^#[^\n]*', re.S | re.M)
NUMBER = r"(?<![\w.'\[])((?!0\.0*(?!\d))\d+\.\d*(?:e[-+]?\d+)?|\d+e[-+]?\d+|[1-9]\d+|[3-9])(?![\w.'\]])"
KINDS = {  # of a mutation: where it applies, and the text in the place of the pattern's first group
    "operator": (r" (\+|-|\*|/|<|>|<=|>=|==|!=|&&|\|\|) ", lambda text: OPPOSITES[text]),
    "sign": (r"(?:return |= |\(|, )(-)(?=[\w(])", lambda text: ""),
    "number": (NUMBER, lambda text: str(1.5 * float(text)) if re.search("[.e]", text) else str(int(text) * 3 // 2)),
    "condition": (r"\bif \(((?:[^();\n]|\((?:[^();\n]|\([^();\n]*\))*\))+)\)", lambda text: f"!({text})"),
    "early return": (r"\n(?:void|bool|double|int)(?: \w+::| )\w+\([^{};]*\)(?: const)?( \{)\n", None),
}
SAID = "{path}:{line} {kind}: {before!r} -> {after!r} in {text!r}"
EARLY = {"void": "return;", "bool": "return false;", "double": "return 0;", "int": "return 0;"}


def sources():
    paths = subprocess.check_output(["git", "ls-files", *(f"{folder}/*.cpp" for folder in FOLDERS)], text=True).split()
    return [path for path in paths if not re.search(r"_test\.cpp$|/test_|^lapservo/testing/", path)]


def draw(rng, weights):
    """A mutation of a source that is chosen by its length; None where none applies."""
    path = rng.choices(list(weights), weights.values())[0]
    text = Path(path).read_text()
    code = NOT_CODE.sub(lambda match: re.sub(r"[^\n]", " ", match.group()), text)
    kind = rng.choice(list(KINDS))
    pattern, changed = KINDS[kind]
    places = list(re.finditer(pattern, code))
    if not places:
        return None
    match = rng.choice(places)
    start, end = match.span(1)
    after = changed(text[start:end]) if changed else f" {{ {EARLY[match.group().split()[0]]}"
    line = text.count("\n", 0, start) + 1
    return {"path": path, "line": line, "kind": kind, "start": start, "before": text[start:end], "after": after,
            "text": text.splitlines()[line - 1].strip()}


def built_programs():
    names = subprocess.check_output(["ninja", "-C", "build", "-t", "targets", "all"], text=True)
    found = re.findall(r"^((?:modules|recordings|transports|web)/\S*_test): CXX_EXECUTABLE", names, re.M)
    programs = {Path(path).name.removesuffix("_test"): path for path in found if "[" not in path and Path("build", path).exists()}
    assert build(programs.values(), 3600), "the tests don't build"
    return programs


def users(path):
    """The modules whose tests are run for a source: its own and those that use it directly; None outside of lapservo/: all that link it."""
    text = Path("build/modules.cmake").read_text()
    folders = dict(re.findall(r"set\((\w+)_FOLDER (\S+)\)", text))
    inside = [name for name, folder in folders.items() if path.startswith(folder + "/")]
    if not inside:
        return None
    own, uses = max(inside, key=lambda name: len(folders[name])), re.findall(r'set\((\w+)_(?:USES|PRIVATE) "(.*)"\)', text)
    return {own} | {name for name, used in uses if f"lapservo::{own}" in used.split(";")}


def build(targets, most_s=BUILD_S):
    try:
        return subprocess.run(["ninja", "-C", "build", *targets], stdout=subprocess.DEVNULL, timeout=most_s).returncode == 0
    except subprocess.TimeoutExpired:
        return False


def run_once(program, left_out):
    """Failed tests, seconds by test, and the test in which the program crashed or hung."""
    command = [f"build/{program}", "--gtest_filter=-" + ":".join(left_out)]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True, errors="replace", start_new_session=True)
    try:
        output = process.communicate(timeout=TESTS_S if left_out else None)[0]
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)
        output = process.communicate()[0]
    begun = re.findall(r"^\[ RUN      \] (\S+)", output, re.M)
    ended = re.findall(r"\[  (     OK|FAILED |SKIPPED) \] (\S+?),? .*\((\d+) ms\)$", output, re.M)
    failed = [name for end, name, _ in ended if end == "FAILED "]
    seconds = {name: int(ms) / 1000 for _, name, ms in ended}
    broken = begun[-1] if begun and begun[-1] not in seconds and process.returncode != 0 else None
    return failed, seconds, broken


def failing(program, left_out):
    failures, left_out = set(), list(left_out)
    for _ in range(5):
        failed, seconds, broken = run_once(program, left_out)
        failures.update(failed + [broken] * bool(broken))
        if not broken:
            return sorted(failures)
        left_out += [broken, *seconds]
    return sorted(failures)


def baseline(programs):
    left_out = {}
    for name, program in programs.items():
        failed, seconds, _ = run_once(program, [])
        left_out[name] = sorted(set(failed) | {test for test, time_s in seconds.items() if time_s > SLOW_S}) or ["none"]
        print(f"{name}: {len(seconds)} tests, {sum(seconds.values()):.0f} s; left out: {', '.join(left_out[name])}", flush=True)
    return left_out


def try_out(mutation, programs, left_out):
    """Sets which tests caught it; False where none of them uses it, or it does not compile."""
    using = users(mutation["path"])
    chosen = {name: program for name, program in programs.items() if using is None or name in using}
    path, whole = Path(mutation["path"]), Path(mutation["path"]).read_text()
    end = mutation["start"] + len(mutation["before"])
    if not chosen:
        return False
    path.write_text(whole[:mutation["start"]] + mutation["after"] + whole[end:])
    try:
        plan = subprocess.run(["ninja", "-C", "build", "-n", *chosen.values()], capture_output=True, text=True).stdout
        affected = {name: program for name, program in chosen.items() if f"executable {program}\n" in plan + "\n"}
        if not affected or not build(affected.values()):
            return False
        mutation["caught_by"] = [f"{name}: {test}" for name, program in affected.items() for test in failing(program, left_out[name])]
        return True
    finally:
        path.write_text(whole)


def lost(table):
    """Caught mutations whose tests are gone; a test's name without its module, a parametrised one's prefix and number."""
    paths = subprocess.check_output(["git", "ls-files", "*_test.cpp"], text=True).split()
    macro = re.compile(r"^(?:TYPED_)?TEST(?:_F|_P)?\((\w+),\s*(\w+)\)", re.M)
    present = {".".join(test) for path in paths for test in macro.findall(Path(path).read_text())}
    names = lambda mutation: {part for test in mutation["caught_by"] for part in test.split(": ")[1].split("/") if "." in part}  # noqa: E731
    return [mutation for mutation in table["mutations"] if mutation["caught_by"] and not names(mutation) & present]


def run(arguments):
    file, end = Path(arguments.table), time.time() + 60 * arguments.minutes
    programs = built_programs()
    table = json.loads(file.read_text()) if file.exists() else {"seed": arguments.seed, "left_out": baseline(programs), "mutations": []}
    rng = random.Random(f"{arguments.seed} {len(table['mutations'])}")
    weights = {path: Path(path).read_text().count("\n") for path in sources()}
    while len(table["mutations"]) < arguments.count and time.time() < end:
        mutation = draw(rng, weights)
        if mutation and try_out(mutation, programs, table["left_out"]):
            table["mutations"].append(mutation)
            file.write_text(json.dumps(table, indent=1))
            print(f"{len(table['mutations'])}. {SAID.format(**mutation)}: {', '.join(mutation['caught_by']) or 'not caught'}", flush=True)


def list_lost(arguments):
    table = json.loads(Path(arguments.table).read_text())
    for mutation in lost(table):
        print(f"{SAID.format(**mutation)}: only {', '.join(mutation['caught_by'])}")
    caught = sum(bool(mutation["caught_by"]) for mutation in table["mutations"])
    print(f"{len(table['mutations'])} mutations, {caught} caught, of these {len(lost(table))} by removed tests only")


def again(arguments):
    table = json.loads(Path(arguments.table).read_text())
    programs = built_programs()
    for mutation in lost(table):
        assert Path(mutation["path"]).read_text()[mutation["start"]:].startswith(mutation["before"]), f"{mutation['path']} has changed"
        try_out(mutation, programs, table["left_out"])
        print(f"{SAID.format(**mutation)}: {', '.join(mutation['caught_by']) or 'LOST'}", flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("mode", choices=["run", "lost", "again"])
    parser.add_argument("table")
    for option, usual in {"--count": 100, "--seed": 1, "--minutes": 35}.items():
        parser.add_argument(option, type=int, default=usual)
    arguments = parser.parse_args()
    for number in (signal.SIGINT, signal.SIGTERM):  # then the source is put back, also in the background
        signal.signal(number, signal.default_int_handler)
    {"run": run, "lost": list_lost, "again": again}[arguments.mode](arguments)


main()
