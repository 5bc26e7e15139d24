"""Every block of commands and code in README.md, CONTRIBUTING.md and docs/ is run, in its page's order.

A page has a folder with what it takes for granted. Recordings are folders of pictures, whatever their names end in: what
compression does to a calibration is measured elsewhere.
"""

import os
import pathlib
import re
import shutil
import signal
import subprocess
import sys
import time

import pytest
from conftest import SOURCE
from recordings import FPS, TOOL, Recordings, board_pictures, swinging

import lapservo

BUILD = pathlib.Path(TOOL).resolve().parent
PAGES = [SOURCE / "README.md", SOURCE / "CONTRIBUTING.md", *sorted((SOURCE / "docs").glob("*.md"))]
RUN = ("sh", "python", "cpp", "yaml")

#: Pages that a test of their own runs from the first block to the last.
ELSEWHERE = {"tutorial.md": "acceptance/tutorial_test.cpp", "quickstart.md": "debian/tests/quickstart"}

#: What can't be run, by how it begins, and why.
NOT_RUN = {
    "git clone <": "fetches",
    "./dev ": "installs and builds; CI runs it",
    "pip install ": "builds; the test python.install does it with what is built",
    "cmake --": "builds",
    "build/modules/": "builds; the tests run it",
    "ctest ": "runs the tests that this is one of",
    "build/lapservo experiment all": "minutes; the tests of lapservo/experiments run each",
    "build/lapservo calibrate all": "once more what the lines above it do; tutorial_test runs it",
    "rosbag record": "is ROS's own; the tests of recordings/ have bags that its library wrote",
    "lapservo calibrate registration swing.bag": "its bag; command_line_test",
    "lapservo track swing.bag": "its bag; command_line_test",
    "lapservo servo --replay swing.bag": "its bag; command_line_test",
    "ssh ": "another computer",
}
#: What takes a camera that is not here: all that it says is right when its complaint is about the camera.
NO_CAMERA = {"/dev/video0": "/dev/video0", "track 0 ": "0", "view 0 ": "0"}
#: What goes on until it is stopped: beside the lines that follow, or for a while.
SERVICES = re.compile(r"(\S*lapservo sim-robot|rosmaster) ")
ENDLESS = re.compile(r"ros[12]:")
WHILE_S = 6


class Block:
    def __init__(self, page, line, language, text):
        self.page, self.line, self.language, self.text = page, line, language, text

    def commands(self):
        return [line for line in re.sub(r"\\\n", "", self.text).splitlines() if line.strip()]


def blocks_of(page):
    found, language, begin, lines = [], None, 0, []
    for number, line in enumerate(page.read_text().splitlines(), 1):
        fence = line.strip().startswith("```")
        if fence and language is None:
            language, begin, lines = line.strip()[3:], number, []
        elif fence:
            found.append(Block(page, begin, language, "\n".join(lines)))
            language = None
        elif language is not None:
            lines.append(line)
    assert language is None, f"{page.name}:{begin}: has no end"
    return found


def reason_not_run(command):
    return next((why for begin, why in NOT_RUN.items() if command.startswith(begin)), None)


def test_every_block_says_what_it_is():
    for page in PAGES:
        for block in blocks_of(page):
            assert block.language in (*RUN, "text") or block.language.startswith("{"), f"{page.name}:{block.line}"


def test_what_is_not_run_is_in_the_pages():
    commands = [command for page in PAGES for block in blocks_of(page) if block.language == "sh" for command in block.commands()]
    for begin in NOT_RUN:
        assert any(command.startswith(begin) for command in commands), f"nothing begins with {begin!r} any more"
    for page, test in ELSEWHERE.items():
        assert page in (SOURCE / test).read_text()


@pytest.fixture(scope="session")
def recorded(tmp_path_factory):
    recordings = Recordings(tmp_path_factory.mktemp("recorded"))
    recordings.record("swing", swinging, 72)
    boards = recordings.folder / "boards"
    boards.mkdir()
    for i, picture in enumerate(board_pictures(recordings.rig.camera)):
        (boards / f"{i}.png").write_bytes(lapservo.Picture(picture)._repr_png_())
    return recordings


@pytest.fixture
def environment():
    domain = str(100 + os.getpid() % 100)
    return os.environ | {"PATH": f"{BUILD}:{os.environ['PATH']}", "ROS_LOCALHOST_ONLY": "1", "ROS_DOMAIN_ID": domain,
                         "ROS_IP": "127.0.0.1", "ROS_MASTER_URI": "http://127.0.0.1:11311"}


def furnished(folder, recorded):
    for name in ("configs", "examples", "acceptance"):
        (folder / name).symlink_to(SOURCE / name)
    (folder / "build").symlink_to(BUILD)
    for name in ("boards", "boards.mp4"):
        shutil.copytree(recorded.folder / "boards", folder / name)
    for name in ("swing.mp4", "motion.mp4", "turn.mp4", "turn"):
        shutil.copytree(recorded.folder / "swing", folder / name, ignore=shutil.ignore_patterns("rig.yaml", "truth.csv"))
    shutil.copy(recorded.folder / "swing_joints.csv", folder / "joints.csv")
    for name in ("rig.yaml", "my_rig.yaml", "designed.yaml"):
        shutil.copy(recorded.folder / "rig.yaml", folder / name)
    subprocess.run([TOOL, "track", "swing.mp4", "--rig", "rig.yaml", "--out", "seen.csv"], cwd=folder, check=True,
                   capture_output=True)


class Shell:
    def __init__(self, folder, environment):
        self.folder, self.environment, self.services = folder, environment, []

    def start(self, command):
        return subprocess.Popen(["bash", "-c", f"exec {command}"], cwd=self.folder, env=self.environment, text=True,
                                stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT)

    def run(self, command):
        if reason_not_run(command):
            return
        command = command.partition("  #")[0].strip()
        if command.startswith("export "):
            return
        if SERVICES.match(command):
            self.services.append(self.start(command))
            return time.sleep(2)
        if re.search(r"calibrate (colour|marker|registration)|lapservo check", command):
            command += f" --fps {FPS}"
        camera = next((word for word in NO_CAMERA if word in command + " "), None)
        running = self.start(command)
        if ENDLESS.search(command) and not camera:
            time.sleep(WHILE_S)
            assert running.poll() is None, f"{command}\n{running.communicate()[0]}"
            running.send_signal(signal.SIGINT)
        said = running.communicate(timeout=300)[0]
        if camera:
            assert running.returncode == 2 and NO_CAMERA[camera] in said, f"{command}\n{said}"
        else:
            tells = ENDLESS.search(command) or "check" in command  # 1: what was found is not good enough, or not yet
            assert running.returncode in ((0, 1) if tells else (0,)), f"{command}\n{said}"

    def end(self):
        for service in self.services:
            service.send_signal(signal.SIGINT)
        for service in self.services:
            service.communicate(timeout=60)
        self.services = []


def run_cpp(block, folder):
    library = BUILD / "liblapservo.so"
    if not library.exists():
        pytest.skip(f"{library} is not built")
    (folder / "see.cpp").write_text("#include <cmath>\n#include <cstdio>\n" + block.text)
    includes = ["-I", SOURCE, "-isystem", "/usr/include/eigen3", "-isystem", "/usr/include/opencv4"]
    subprocess.run(["g++", "-std=c++20", "-Wall", "-Werror", *includes, "see.cpp", "-o", "see", library, f"-Wl,-rpath,{BUILD}"],
                   cwd=folder, check=True)
    example = SOURCE / "acceptance" / "frames" / "png"
    said = subprocess.run(["./see", example / "rig.yaml", example / "0000.png"], cwd=folder, check=True, capture_output=True,
                          text=True).stdout
    assert re.match(r"psi = -?[0-9.]+ rad, sigma = 0\.0[0-9]+ rad\n", said), said


@pytest.mark.parametrize("page", [page for page in PAGES if page.name not in ELSEWHERE], ids=lambda page: page.name)
def test_every_block_runs(page, recorded, environment, tmp_path):
    blocks = [block for block in blocks_of(page) if block.language in RUN]
    commands = [command for block in blocks if block.language == "sh" for command in block.commands()]
    if any(not reason_not_run(command) for command in commands):
        furnished(tmp_path, recorded)
    elif blocks:
        (tmp_path / "configs").symlink_to(SOURCE / "configs")
    shell, arm = Shell(tmp_path, environment), Shell(tmp_path, environment)
    for block in blocks:
        print(f"{page.name}:{block.line}", flush=True)
        if block.language == "yaml":
            assert lapservo.Rig.parse(block.text).instruments
        elif block.language == "cpp":
            run_cpp(block, tmp_path)
        elif block.language == "python":
            if "video.mp4" in block.text:
                subprocess.run([TOOL, "render", "--rig", "configs/paper.yaml", "--count", "3", "--seed", "1", "--out", "video.mp4"],
                               cwd=tmp_path, check=True, capture_output=True)
            subprocess.run([sys.executable, "-c", block.text], cwd=tmp_path, env=environment, check=True)
        else:
            own = any(SERVICES.match(command) for command in block.commands())
            try:
                for command in block.commands():
                    if "ros2:" in command and not own:  # the page's arm and camera
                        arm.run(f"lapservo sim-robot --rig {SOURCE}/configs/paper.yaml ")
                        shutil.copy(SOURCE / "configs" / "paper.yaml", tmp_path / "rig.yaml")
                    shell.run(command)
                    arm.end()
            finally:
                shell.end()
                arm.end()
