"""An arm and an endoscope over ROS 2, and its bags, in Python."""

import os
import re
import shlex
import subprocess
import sys
import time

import numpy as np
import pytest
from conftest import Q, SOURCE
from test_lapservo import with_shifted_joints

import lapservo

TOOL = os.environ["LAPSERVO_TOOL"]
LIMITS = SOURCE / "configs" / "joint_limits" / "psm-classic.yaml"
RIG = SOURCE / "configs" / "paper.yaml"
if not hasattr(lapservo, "Ros2Robot"):
    pytest.skip("built without Cyclone DDS", allow_module_level=True)


@pytest.fixture(scope="module")
def arm():
    """A simulated arm and endoscope, which are at work, in the environment."""
    environment = {"ROS_LOCALHOST_ONLY": "1", "ROS_DOMAIN_ID": "61"}
    os.environ.update(environment)
    arm = subprocess.Popen([TOOL, "sim-robot", "--rig", RIG, "--start", ",".join(map(str, Q))], stdout=subprocess.PIPE, text=True)
    yield arm
    arm.terminate()
    arm.wait()
    for name in environment:
        del os.environ[name]


@pytest.fixture
def theatre(arm):
    return os.environ


def test_the_command_that_the_simulated_arm_prints_moves_it(arm):
    printed = re.search(r"(lapservo servo .*) moves it", arm.stdout.readline())[1]
    helped = re.search(r"lapservo servo .*", subprocess.run([TOOL, "sim-robot", "--help"], capture_output=True, text=True).stdout)[0]
    for command in (printed, helped):
        _, *arguments = shlex.split(command)
        ran = subprocess.run([TOOL, *arguments, "--duration", "2"], cwd=SOURCE, capture_output=True, text=True)
        assert ran.returncode in (0, 1) and "  track\n" in ran.stdout, ran.stdout + ran.stderr


def test_an_arm_is_steered_and_a_bag_of_it_is_read(theatre, rig, tmp_path):
    ran = subprocess.run([sys.executable, SOURCE / "examples" / "python" / "ros2_robot.py", "SIM_PSM1", RIG, LIMITS, "6",
                          "--enable-motion"], capture_output=True, text=True, env=theatre)
    assert ran.returncode == 0 and ran.stdout.startswith("errors at the end: "), ran.stderr
    bag = tmp_path / "swing.bag"
    subprocess.run([TOOL, "record", "--rig", RIG, "--robot", "ros2:SIM_PSM1", "--camera", "ros2:/endoscope/image_raw",
                    "--duration", "2", "--out", bag], check=True, capture_output=True, env=theatre)
    frames = list(lapservo.open_frames(bag))
    assert len(frames) > 5 and frames[0].image.shape == (720, 1280, 3)
    assert all(a.time_s < b.time_s for a, b in zip(frames, frames[1:]))
    assert lapservo.Tracker(rig).track(frames[-1])[0].ok
    assert len(list(lapservo.open_frames(bag, image_topic="/endoscope/image_raw"))) == len(frames)
    with pytest.raises(lapservo.InputError, match="/other"):
        lapservo.open_frames(bag, image_topic="/other")
    with pytest.raises(lapservo.InputError, match="is no bag"):
        lapservo.open_frames(RIG, image_topic="/endoscope/image_raw")


def test_without_motion_enabled_nothing_is_sent_and_a_goal_that_can_not_be_reached_is_refused(theatre, rig):
    clock = lapservo.SteadyClock()
    controller = lapservo.Controller(rig, period_s=1 / 60, joint_limits=LIMITS)
    images = lapservo.Ros2Camera("/endoscope/image_raw", rig, clock)
    robot = lapservo.Ros2Robot("SIM_PSM1", rig, controller, clock)
    before, ticks = robot.state(), []
    assert not before.follows
    with pytest.raises(lapservo.InputError, match="can't be followed"):
        lapservo.run(robot, images, clock, rig, lapservo.set_point([0, 0, 0, 0]), 1, controller=controller)
    goal = lapservo.Kinematics(rig).features(before.q) + [0.02, 10, 5, 5]
    lapservo.run(robot, images, clock, rig, lapservo.set_point(goal), 1.5, controller=controller, own_thread=True,
                 on_tick=ticks.append)
    assert any(tick.image is not None for tick in ticks) and robot.state().operating_state == "ENABLED"
    assert np.abs(robot.state().q - before.q).max() < 1e-3


def test_an_onlooker_takes_nothing_from_the_loop(theatre, rig):
    robot = lapservo.Ros2Robot("SIM_PSM1", rig, lapservo.Controller(rig), lapservo.SteadyClock())

    class HandedOn(lapservo.Robot):
        def state(self):
            return robot.state()

        def readings(self):
            return robot.readings()

    def wait_for(read, blocked, meanwhile=lambda: None):
        while read().blocked != blocked:
            meanwhile()
            time.sleep(0.01)

    loop = HandedOn()
    wait_for(lambda: lapservo.Robot.state(loop), "none")
    other = lapservo.Ros2Arm("SIM_PSM1", rig.instruments[0].joints.names)
    wait_for(robot.state, "second_source", lambda: other.publish(np.zeros(4), np.zeros(4)))
    wait_for(robot.state, "none")
    assert lapservo.Robot.state(loop).blocked == "second_source"
    looked_at = [time_s for time_s, _ in robot.readings()]
    taken = [time_s for time_s, _ in lapservo.Robot.readings(loop)]
    assert len(looked_at) > 5 and set(looked_at[10:]) <= set(taken)  # the newest thousand
    assert not set(taken) & {time_s for time_s, _ in lapservo.Robot.readings(loop)}


def test_an_arm_is_moved_by_its_own_entry_of_the_rig_only(theatre, rig):
    clock, controller, own = lapservo.SteadyClock(), lapservo.Controller(rig), rig.instruments[0]
    marker = lapservo.Marker(diameter_m=0.008, bands_upper_m=own.marker.bands_upper_m, bands_lower_m=own.marker.bands_lower_m,
                             hues_deg=[180, 270, 90])
    both = lapservo.Rig(rig.camera, [lapservo.Instrument("PSM2", marker, joints=own.joints), own])
    with pytest.raises(lapservo.InputError, match="is PSM2, expected PSM1, or"):
        lapservo.Ros2Robot("/dvrk/SIM_PSM1", both, controller, clock)
    robot = lapservo.Ros2Robot("SIM_PSM1", rig, controller, clock)
    images = lapservo.Ros2Camera("/endoscope/image_raw", rig, clock)
    with pytest.raises(lapservo.InputError, match="is PSM2, expected PSM1, which the robot moves"):
        lapservo.run(robot, images, clock, both, lapservo.paper_trajectory(), 1)
    with pytest.raises(lapservo.InputError, match="joints: is others, expected those by which the robot reads its arm"):
        lapservo.run(robot, images, clock, with_shifted_joints(rig), lapservo.paper_trajectory(), 1)
    with pytest.raises(lapservo.InputError, match="Ros2Robot: .*joints: is others, expected those by which the controller"):
        lapservo.Ros2Robot("SIM_PSM1", with_shifted_joints(rig), lapservo.Controller(rig, joint_limits=LIMITS), clock)


def test_the_wrist_of_the_rigs_tool_is_read(theatre, rig):
    joint = ("    tool: {joints: [{name: wrist_pitch, alpha_rad: -1.57}], tip_in_last_joint_m: [0.01, 0, 0], "
             "wrist_in_marker_m: [0, 0, 0.03], azimuth_rad: 0}\n")
    clock = lapservo.SteadyClock()
    for of, expected in ((rig, []), (lapservo.Rig.parse(rig.to_yaml() + joint), [0.1])):
        robot = lapservo.Ros2Robot("SIM_PSM1", of, lapservo.Controller(of), clock)
        assert robot.state().wrist_rad == pytest.approx(expected)


def test_what_is_not_there_is_said(theatre, rig):
    clock = lapservo.SteadyClock()
    controller = lapservo.Controller(rig)
    with pytest.raises(lapservo.InputError, match="no /PSM9/measured_js with the rig's joints within 0.3 s"):
        lapservo.Ros2Robot("PSM9", rig, controller, clock, wait_s=0.3, instrument="PSM1")
    bare = lapservo.Rig(rig.camera, [lapservo.Instrument("PSM1", rig.instruments[0].marker)])
    with pytest.raises(lapservo.InputError, match="joints"):
        lapservo.Ros2Robot("SIM_PSM1", bare, controller, clock)
    with pytest.raises(lapservo.InputError, match="joints"):
        lapservo.Controller(bare, joint_limits=LIMITS)
    with pytest.raises(lapservo.InputError, match="none.yaml"):
        lapservo.Controller(rig, joint_limits="none.yaml")


def test_the_arms_side_refuses_what_can_not_be(theatre):
    side = lapservo.Ros2Arm("OTHER", ["yaw", "pitch"])
    assert side.new_setpoint() is None and side.new_commands() == [] and side.malformed == 0
    side.publish([0, 0], np.zeros(2), "PAUSED", is_busy=True)
    for arguments, expected in ((([0], [0, 0]), "2 names"), (([0, 0], [0, 0], "ON"), "DISABLED, ENABLED"), (("yaw", [0, 0]), "measured")):
        with pytest.raises(lapservo.InputError, match=expected):
            side.publish(*arguments)
    with pytest.raises(lapservo.InputError, match="Ros2ImagePublisher.publish"):
        lapservo.Ros2ImagePublisher("/other/image_raw").publish(np.zeros((2, 2)))
