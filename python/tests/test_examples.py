import json
import os
import shutil
import signal
import subprocess
import sys
import time
import urllib.request

import lapservo
import numpy as np
import pytest
from conftest import SOURCE
from ros_master import free_port, wait_for_master

EXAMPLES = SOURCE / "examples" / "python"
RIG = SOURCE / "configs" / "paper.yaml"


def run(name, *arguments):
    return subprocess.run([sys.executable, EXAMPLES / name, *arguments], check=True, capture_output=True, text=True).stdout


def test_examples_run(tmp_path):
    frames = tmp_path / "frames"
    subprocess.run([os.environ["LAPSERVO_TOOL"], "render", "--rig", RIG, "--count", "12", "--moving", "--out", frames],
                   check=True, capture_output=True)
    assert run("track_video.py", frames, RIG).count(" mm, ") == 12
    run("plot_q.py", frames, RIG, tmp_path / "q.png")
    assert (tmp_path / "q.png").read_bytes().startswith(b"\x89PNG")
    assert "RCM at" in run("rcm_image.py", frames, RIG)
    assert "mrad" in run("marker_5mm.py", tmp_path / "sheet.pdf")
    assert (tmp_path / "sheet.pdf").is_file()
    assert "largest errors" in run("own_robot.py", RIG)


def test_the_tip_goes_to_pixels_of_the_page(tmp_path):
    (tmp_path / "tip.yaml").write_text(RIG.read_text() + "    tool: {tip_in_marker_m: [0, 0, 0.045]}\n")
    servo = subprocess.Popen([os.environ["LAPSERVO_TOOL"], "servo", "--rig", tmp_path / "tip.yaml", "--robot", "sim", "--duration", "3600",
                              "--web", "0"], stdout=subprocess.PIPE, text=True)
    try:
        page = servo.stdout.readline().split()[1]

        def state():
            return json.load(urllib.request.urlopen(f"{page}state"))

        def goal_of_a_click(image):
            before = state()
            urllib.request.urlopen(urllib.request.Request(f"{page}tip?u=760&v=430&image={image}&at={before['now_s']}", method="POST",
                                                          headers={"Origin": page[:-1]}))
            while (answer := state()["loop"]["answer"]) == before["loop"]["answer"]:
                time.sleep(0.1)
            assert answer.startswith("a goal of the tip came"), answer
            time.sleep(2)
            return np.array([one["desired"] for one in state()["loop"]["features"][1:]])

        while (state()["loop"] or {"time_s": 0})["time_s"] < 7:  # by then the paper's trajectory has changed the tip's depth
            time.sleep(0.1)
        late = state()["images"]
        first, of_early, again = (goal_of_a_click(image) for image in (late, 10, late))
        assert np.abs(first - again).max() < 5 < 20 < np.abs(first - of_early).max(), (first, of_early, again)
        near, corner = run("move_tip.py", page, "760,430", "1,1").splitlines()
        assert near.startswith("760,430: a goal of the tip came"), near
        assert corner.startswith("1,1: refused: tip_goal: "), corner
    finally:
        servo.kill()
        servo.wait()


def test_an_example_without_arguments_says_what_it_needs():
    for path in EXAMPLES.glob("*.py"):
        if path.name not in NOT_RUN:
            without = subprocess.run([sys.executable, path], capture_output=True, text=True)
            assert without.returncode == 1 and without.stderr.startswith(f"{path.name} "), without.stderr


@pytest.mark.skipif(not hasattr(lapservo, "Ros2Arm"), reason="built without Cyclone DDS")
def test_another_robot_is_steered_recorded_and_replayed_by_its_bridge(tmp_path):
    ros = os.environ | {"ROS_LOCALHOST_ONLY": "1", "ROS_DOMAIN_ID": "62"}
    arm = ["--rig", RIG, "--robot", "ros2:PSM1", "--camera", "ros2:/endoscope/image_raw"]

    def lapservo_does(*arguments):
        done = subprocess.run([os.environ["LAPSERVO_TOOL"], *arguments], capture_output=True, text=True, env=ros)
        assert done.returncode == 0, done.stdout + done.stderr
        return done.stdout

    bridge = subprocess.Popen([sys.executable, EXAMPLES / "crtk_bridge.py", "PSM1", RIG], stdout=subprocess.DEVNULL, env=ros)
    try:
        said = lapservo_does("servo", *arm, "--enable-motion", "--joint-limits", SOURCE / "configs/joint_limits/psm-classic.yaml",
                             "--set-point", "0.9,795,365,212", "--duration", "15", "--out", tmp_path / "run")
        assert "within 1 px and 5 mrad from" in said
        lapservo_does("servo", "--replay", tmp_path / "run" / "log.csv")
        lapservo_does("record", *arm, "--duration", "2", "--out", tmp_path / "bag")
        lapservo_does("track", tmp_path / "bag", "--rig", RIG, "--out", tmp_path / "seen.csv")
    finally:
        bridge.send_signal(signal.SIGINT)
        assert bridge.wait(20) == 0


@pytest.fixture
def ros(tmp_path):
    """A rosmaster of its own on loopback, and this process a node of it."""
    rospy = pytest.importorskip("rospy")
    master = shutil.which("rosmaster") or pytest.skip("python3-rosmaster is not installed")
    port = free_port()
    os.environ.update(ROS_MASTER_URI=f"http://127.0.0.1:{port}", ROS_IP="127.0.0.1", ROS_LOG_DIR=str(tmp_path))
    running = subprocess.Popen([master, "--core", "-p", str(port)], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    wait_for_master(os.environ["ROS_MASTER_URI"])
    rospy.init_node("test", disable_signals=True, disable_rosout=True)
    yield rospy
    rospy.signal_shutdown("the test is over")
    running.kill()
    running.wait()


def test_the_ros_node_publishes_what_it_sees(ros, tmp_path):
    from sensor_msgs.msg import Image, JointState

    q = np.array([0.05, 1.57, 0.064, 1.2])
    picture = lapservo.Renderer(lapservo.Rig.load(RIG)).render(q, seed=1)
    image = Image(height=picture.shape[0], width=picture.shape[1], encoding="bgr8", step=3 * picture.shape[1])
    image.data = picture.tobytes()
    images = ros.Publisher("/endoscope/image_raw", Image, queue_size=1)
    heard = []
    ros.Subscriber("/lapservo/PSM1/q", JointState, heard.append)
    node = subprocess.Popen([sys.executable, EXAMPLES / "ros_node.py", RIG])
    try:
        for _ in range(150):
            image.header.stamp = ros.Time.now()
            images.publish(image)
            time.sleep(0.2)
            if heard or node.poll() is not None:
                break
    finally:
        node.kill()
        node.wait()
    assert heard, "nothing came within 30 s"
    assert np.abs(np.array(heard[0].position) - q).max() < 0.005


#: Debian has no rclpy, ROS 2's Python: this one is compiled only.
NOT_RUN = ("ros2_node.py",)


def test_each_example_runs():
    tests = "".join((SOURCE / "python" / "tests" / name).read_text() for name in ("test_examples.py", "test_ros2.py"))
    pages = "".join(page.read_text() for page in (SOURCE / "docs").glob("*.md"))  # test_docs.py runs their commands
    for path in EXAMPLES.glob("*.py"):
        compile(path.read_text(), path, "exec")
        assert f'"{path.name}"' in tests or f"python3 examples/python/{path.name} " in pages
