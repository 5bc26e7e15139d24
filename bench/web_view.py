"""The cost of the live page and of a bag for the loop, and the age of the page's images: web_view.py LAPSERVO RIG [SECONDS].

`lapservo sim-robot` and `lapservo servo` over ROS 2 on this computer, at the rig's size and 30 frames/s: without the page, with
one viewer, with a crowd of a thousand connections as well, and with `lapservo record` in its place. Printed: how late the loop's
ticks begin (of log.csv), how late an empty loop of the same rate and priority wakes meanwhile (this machine's own part), and the
age of each image, from when the image came to the loop to when a viewer on this computer has it whole.
"""

import csv
import http.client
import multiprocessing
import os
import re
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time

PERIODS_PER_S = 120
LOOP_PRIORITY = 10  # of lapservo's loop (lapservo/robot/real_time.h)
SETTLING_S = 2


def quantile(values, fraction):
    values = sorted(values)
    return values[min(len(values) - 1, int(fraction * len(values)))] if values else float("nan")


def quantiles(late_ms):
    return ", ".join(f"p{100 * q:g} {quantile(late_ms, q):.2f}" for q in (0.5, 0.99, 0.999))


def lateness_ms(log):
    """The place of each of the loop's ticks in its period, from the earliest place of a second's ticks on."""
    with open(log, newline="") as file:
        times = [float(row["time_s"]) for row in csv.DictReader(file)]
    begin = times[0]
    return [1000 * ((t - begin) - round((t - begin) * PERIODS_PER_S) / PERIODS_PER_S) for t in times if t > begin + SETTLING_S]


def empty_loop(ended, late_ms):
    """Wakes once a period until `ended`, does nothing, and sends how late each wake-up was."""
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(LOOP_PRIORITY))
    except PermissionError:
        print("the empty loop has no real-time priority", file=sys.stderr)
    late, due = [], time.monotonic()
    while not ended.is_set():
        due += 1 / PERIODS_PER_S
        time.sleep(max(0, due - time.monotonic()))
        late.append(1000 * (time.monotonic() - due))
    late_ms.put(late[SETTLING_S * PERIODS_PER_S:])


class Viewer(threading.Thread):
    """Requests the next image as soon as it has one, as the page does."""

    def __init__(self, port):
        super().__init__(daemon=True)
        self.port, self.ages_ms = port, []

    def run(self):
        number, connection = 0, http.client.HTTPConnection("127.0.0.1", self.port, timeout=5)
        begin = time.monotonic()
        while True:
            try:
                connection.request("GET", f"/picture?after={number}")
                answer = connection.getresponse()
                answer.read()
            except OSError:
                return
            if answer.status == 200:
                number = int(answer.headers["X-Number"])
                if time.monotonic() > begin + SETTLING_S:
                    self.ages_ms.append(1000 * (time.monotonic() - float(answer.headers["X-Came-S"])))


class Crowd(threading.Thread):
    """A thousand connections that say nothing, again and again."""

    def __init__(self, port):
        super().__init__(daemon=True)
        self.port, self.ended = port, False

    def run(self):
        while not self.ended:
            crowd = []
            for _ in range(1000):
                one = socket.socket()
                one.setblocking(False)
                one.connect_ex(("127.0.0.1", self.port))
                crowd.append(one)
            time.sleep(1)
            for one in crowd:
                one.close()


def run(tool, rig, duration_s, web, crowded, recorded):
    environment = dict(os.environ, ROS_LOCALHOST_ONLY="1", ROS_DOMAIN_ID=os.environ.get("ROS_DOMAIN_ID", "87"))
    with tempfile.TemporaryDirectory() as folder:
        arm = subprocess.Popen([tool, "sim-robot", "--rig", rig, "--fps", "30"], env=environment, stdout=subprocess.DEVNULL)
        try:
            loop = subprocess.Popen(
                [tool, "servo", "--rig", rig, "--robot", "ros2:SIM_PSM1", "--camera", "ros2:/endoscope/image_raw", "--enable-motion",
                 "--joint-limits", "configs/joint_limits/psm-classic.yaml", "--duration",
                 str(duration_s), "--fps", str(PERIODS_PER_S), "--out", folder + "/run", *(["--web", "0"] if web else [])],
                env=environment, stdout=subprocess.PIPE, text=True)
            empty_ended, empty_late_ms = multiprocessing.Event(), multiprocessing.Queue()
            multiprocessing.Process(target=empty_loop, args=(empty_ended, empty_late_ms), daemon=True).start()
            viewer = crowd = bag = None
            if recorded:
                bag = subprocess.Popen([tool, "record", "--camera", "ros2:/endoscope/image_raw", "--robot", "ros2:SIM_PSM1", "--out",
                                        folder + "/bag", "--duration", str(duration_s + 60)], env=environment,
                                       stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
            for line in loop.stdout:
                if found := re.match(r"page: http://127.0.0.1:(\d+)/", line):
                    viewer = Viewer(int(found[1]))
                    viewer.start()
                    if crowded:
                        crowd = Crowd(int(found[1]))
                        time.sleep(0.5)
                        crowd.start()
            loop.wait()
            empty_ended.set()
            if bag:
                bag.send_signal(signal.SIGINT)
                bag.wait()
            if crowd:
                crowd.ended = True
            return lateness_ms(folder + "/run/log.csv"), empty_late_ms.get(), viewer.ages_ms if viewer else []
        finally:
            arm.terminate()
            arm.wait()


def main():
    tool, rig = sys.argv[1:3]
    duration_s = float(sys.argv[3]) if len(sys.argv) > 3 else 12
    for name, web, crowded, recorded in (("without the page", False, False, False), ("one viewer", True, False, False),
                                         ("and a thousand connections", True, True, False), ("one viewer and a bag", True, False, True)):
        late_ms, empty_ms, ages_ms = run(tool, rig, duration_s, web, crowded, recorded)
        print(f"{name:28} tick late {quantiles(late_ms)} ms; empty loop {quantiles(empty_ms)} ms", end="")
        if ages_ms:
            seen_s = duration_s - SETTLING_S
            print(f"; image age p50 {quantile(ages_ms, 0.5):.0f}, p95 {quantile(ages_ms, 0.95):.0f} ms, {len(ages_ms) / seen_s:.1f} images/s", end="")
        print(flush=True)


if __name__ == "__main__":
    main()
