"""Runs the lines of a page's blocks of commands, in the page's folder."""

import contextlib
import os
import pathlib
import re
import shutil
import signal
import subprocess
import tempfile
import time

from recordings import TOOL
from ros_master import free_port, wait_for_master

import lapservo

BUILD = pathlib.Path(TOOL).resolve().parent

#: What goes on beside a block's other lines.
SERVICES = re.compile(r"(\S*lapservo sim-robot|rosmaster|\S*python3 \S*crtk_bridge.py) ")
#: Said when they are there.
READY = "Ctrl-C ends this"
#: A loop with an arm, beside which a block's next one goes on.
LOOP, TRACKS = re.compile(r"\S*lapservo servo .*--robot ros[12]:"), "  track\n"
#: What is stopped as soon as it says this, or this file is there, from which on it does what the page is about: the rest takes
#: minutes, or has no end.
ENOUGH = {
    r"\S*lapservo experiment all ": pathlib.Path("results/unfinished/illumination.csv"),
    r"\S*lapservo calibrate all ": r"\ncamera: ",
    r"\S*lapservo view ": "page: http://127.0.0.1",
    LOOP.pattern: TRACKS,
}
#: A device that is not here: the line is right when that is all that is said.
CAMERA, NO_CAMERA = "/dev/video0", "/dev/video-none"
#: What the tests have in its place: a recording for the first camera, any port that is free.
INSTEAD = {r"lapservo (track|view) 0 ": r"lapservo \1 swing.mp4 ", r"--web\b( \d+)?": "--web 0",
           r"lapservo view\b": "lapservo view --web 0", CAMERA: NO_CAMERA}
#: Exit code 1: what was found is not good enough, or the arm is not yet where it shall be.
MAY_BE_1 = re.compile(r"\S*lapservo (check|servo (?!--replay run/)|calibrate all) ")
#: Of what was interrupted: ended by itself, said so, or as shells have it.
INTERRUPTED = (0, 1, 130)
LONGEST_S = 300


class Running:
    def __init__(self, command, folder, environment):
        self.command, self.folder = command, folder
        self.output = tempfile.TemporaryFile("a+", dir=folder)  # so that reading does not move where it writes
        self.process = subprocess.Popen(["bash", "-c", command], cwd=folder, env=environment, stdin=subprocess.DEVNULL,
                                        stdout=self.output, stderr=subprocess.STDOUT, start_new_session=True)

    def said(self):
        self.output.seek(0)
        return f"{self.command}\n{self.output.read()}"

    def wait_for(self, text):
        end_s = time.monotonic() + LONGEST_S
        while not (self.folder / text).exists() if isinstance(text, pathlib.Path) else not re.search(text, self.said()):
            assert self.process.poll() is None and time.monotonic() < end_s, f"{text!r} was not said: {self.said()}"
            time.sleep(0.05)

    def result(self):
        try:
            return self.process.wait(LONGEST_S)
        finally:
            self.signal(signal.SIGKILL)

    def interrupt(self):
        self.signal(signal.SIGINT)
        result = self.result()
        assert result in INTERRUPTED, f"{result} after Ctrl-C: {self.said()}"

    def signal(self, number):
        with contextlib.suppress(ProcessLookupError):
            os.killpg(self.process.pid, number)


class Shell:
    """Its ROS domain, master and page are its own."""

    def __init__(self, folder):
        self.folder, self.port = folder, free_port()
        self.environment = os.environ | {
            "PATH": f"{BUILD}:{os.environ['PATH']}", "PYTHONPATH": str(pathlib.Path(lapservo.__file__).resolve().parents[1]),
            "ROS_LOCALHOST_ONLY": "1", "ROS_DOMAIN_ID": str(20 + os.getpid() % 50), "ROS_IP": "127.0.0.1",
            "ROS_MASTER_URI": f"http://127.0.0.1:{self.port}", "ROS_LOG_DIR": str(folder)}

    def start(self, command):
        for here, instead in (INSTEAD | {"rosmaster --core": f"rosmaster --core -p {self.port}"}).items():
            command = re.sub(here, instead, command)
        return Running(command, self.folder, self.environment)

    def run(self, command):
        begin_s = time.monotonic()
        running = self.start(command)
        try:
            enough = next((text for begin, text in ENOUGH.items() if re.match(begin, command)), None)
            if enough and CAMERA not in command:
                running.wait_for(enough)
                running.interrupt()
                return running.said()
            result = running.result()
        finally:
            running.signal(signal.SIGKILL)
            print(f"{time.monotonic() - begin_s:5.1f} s  {command}")
        if CAMERA in command:
            assert result == 2 and f"{NO_CAMERA}: gives no images" in running.said(), running.said()
        else:
            assert result in ((0, 1) if MAY_BE_1.match(command) else (0,)), running.said()
        return running.said()

    @contextlib.contextmanager
    def beside(self, commands):
        """Services that go on meanwhile. Whatever ends one before is an error."""
        services = []
        with contextlib.ExitStack() as stack:
            for command in commands:
                services.append(self.start(command))
                stack.callback(services[-1].interrupt)
                if command.startswith("rosmaster"):
                    wait_for_master(self.environment["ROS_MASTER_URI"])
                else:
                    services[-1].wait_for(TRACKS if LOOP.match(command) else READY)
            yield
            for service in services:
                assert service.process.poll() is None, service.said()

    def run_all(self, commands):
        """Returns the output of the commands, without that of the services."""
        said = ""
        own = [command for command in commands if SERVICES.match(command)]
        own += [command for command in commands if LOOP.match(command)][:-1]
        with self.beside(own):
            for command in commands:
                if command in own:
                    continue
                with self.beside(self.arm_of(command) if not own else []):
                    said += self.run(command)
        return said

    def arm_of(self, command):
        """The arm and camera that a line takes for granted, slow enough for any computer, and their rig."""
        if "ros2:" not in command:
            return []
        shutil.copy(self.folder / "arm.yaml", self.folder / "rig.yaml")
        return ["lapservo sim-robot --rig arm.yaml --fps 6 --arm PSM1"]
