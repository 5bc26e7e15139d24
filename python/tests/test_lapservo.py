import pickle
import re
import signal
import subprocess
import sys
import threading
import time

import numpy as np
import pytest
from conftest import Q, SOURCE

import lapservo


def free(rig):
    """The rig without camera_from_rcm."""
    return lapservo.Rig(rig.camera, [lapservo.Instrument("PSM1", rig.instruments[0].marker)])


def test_a_rendered_instrument_is_where_it_was_put(rig, image):
    seen = lapservo.Tracker(rig).track(image, 12.5)[0]
    assert seen.ok and seen.status is lapservo.Status.ok and seen.instrument == "PSM1" and seen.stamp_s == 12.5
    assert np.all(np.abs(seen.q - Q) < 4 * np.sqrt(np.diag(seen.q_covariance)))
    assert np.all(np.abs(seen.q - Q) < [1e-3, 1e-3, 1e-4, 5e-3])
    truth = lapservo.camera_from_marker(rig.instruments[0], Q)
    assert np.allclose(seen.marker_pose.camera_from_marker, truth, atol=5e-3)
    assert np.allclose(seen.features, lapservo.Kinematics(rig).features(Q), atol=[0.001, 0.5, 0.5, 0.5])
    assert seen.features_covariance.shape == (4, 4) and np.all(np.linalg.eigvalsh(seen.features_covariance) > 0)


def test_the_tip_follows_the_wrist(rig, image):
    wrist = ("    tool: {joints: [{name: wrist_pitch, alpha_rad: -1.570796326795}], tip_in_last_joint_m: [0.01, 0, 0], "
             "wrist_in_marker_m: [0, 0, 0.03], azimuth_rad: 0}\n")
    wristed = lapservo.Rig.parse(rig.to_yaml() + wrist)
    assert wristed.instruments[0].wrist_joints == ("wrist_pitch",) and rig.instruments[0].wrist_joints == ()
    tracker = lapservo.Tracker(wristed)
    assert tracker.track(image)[0].tip is None
    tracker.set_wrist("PSM1", [-np.pi / 2])
    seen = tracker.track(image)[0]
    tip = seen.tip
    assert np.allclose(tip.camera_from_tip[:3, 3], (seen.marker_pose.camera_from_marker @ [0, 0, 0.04, 1])[:3])
    assert np.all(np.linalg.eigvalsh(tip.covariance) > 0) and np.isclose(tip.sigma_m**2, np.trace(tip.covariance[:3, :3]))
    assert np.isclose(tip.sigma_readings_m, 0.01 * np.pi / 180) and tip.sigma_place_m == 0 < tip.sigma_shaft_m
    assert lapservo.JointState(0, Q, wrist_rad=[0.5]).wrist_rad == (0.5,) and lapservo.JointState(0, Q).wrist_rad == ()
    assert lapservo.Simulator(wristed, Q).state().wrist_rad == pytest.approx([0.1])
    assert pickle.loads(pickle.dumps(seen)) == seen and pickle.loads(pickle.dumps(wristed)) == wristed
    for readings in ([1.0, 2.0], [np.nan]):
        with pytest.raises(lapservo.InputError):
            tracker.set_wrist("PSM1", readings)
    with pytest.raises(lapservo.InputError, match="PSM9"):
        tracker.set_wrist("PSM9", [0.0])


def test_without_a_marker_every_number_is_none(rig):
    seen = lapservo.Tracker(rig).track(np.full((720, 1280, 3), 90, np.uint8))[0]
    assert not seen.ok and seen.status is lapservo.Status.no_marker
    for name in "q q_covariance features cross_ratio tau_rad sigma_tau_rad edges_px marker_pose tip stamp_s".split():
        assert getattr(seen, name) is None, name


def test_without_an_rcm_r_is_not_a_number(rig, image):
    seen = lapservo.Tracker(free(rig)).track(image)[0]
    assert seen.ok and seen.q is None and seen.marker_pose is not None
    assert np.array_equal(np.isnan(seen.features), [False, True, False, False])


def test_cameras_give_frames():
    try:
        source = lapservo.open_frames("gst:videotestsrc num-buffers=3 ! video/x-raw,width=64,height=48,framerate=50/1")
    except lapservo.InputError as error:
        pytest.skip(str(error))  # built without GStreamer
    assert source.frames_per_second == 50
    assert [frame.image.shape for frame in source] == 3 * [(48, 64, 3)]
    assert source.complaint == ""
    with pytest.raises(lapservo.InputError, match="/dev/video-none: gives no images"):
        lapservo.open_frames("/dev/video-none")


def test_who_waits_for_a_camera_lets_others_run_and_hears_signals():
    try:
        source = lapservo.open_frames("gst:videotestsrc is-live=true ! video/x-raw,width=64,height=48,framerate=2/1")
    except lapservo.InputError as error:
        pytest.skip(str(error))  # built without GStreamer
    turns, waiting = 0, threading.Thread(target=lambda: [next(source) for _ in range(5)])
    waiting.start()
    while waiting.is_alive():
        time.sleep(0.001)
        turns += 1
    assert turns > 100

    def interrupt(*_):
        raise TimeoutError

    before = signal.signal(signal.SIGALRM, interrupt)
    try:
        slow = lapservo.open_frames("gst:videotestsrc is-live=true ! video/x-raw,width=64,height=48,framerate=1/4")
        next(slow)
        signal.setitimer(signal.ITIMER_REAL, 0.3)
        begin_s = time.monotonic()
        with pytest.raises(TimeoutError):
            list(slow)
        assert time.monotonic() - begin_s < 2
    finally:
        signal.signal(signal.SIGALRM, before)


def test_an_overlay_is_a_new_picture(rig, image):
    before = image.copy()
    drawn = lapservo.Tracker(rig).track(image)[0].overlay(image)
    assert drawn.shape == image.shape and not np.array_equal(drawn, image) and np.array_equal(image, before)


def test_threads_share_a_tracker(rig, image):
    tracker, seen = lapservo.Tracker(rig), []
    threads = [threading.Thread(target=lambda: seen.extend(tracker.track(image))) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(seen) == 4 and all(o.ok for o in seen)


def test_errors_have_fields(rig):
    text = rig.to_yaml()
    seam = re.search(r"seam_rad: \S+", text)[0]
    with pytest.raises(lapservo.InputError) as caught:
        lapservo.Rig.parse(text.replace(seam, "seam_rad: left"))
    error = caught.value
    assert isinstance(error, ValueError) and error.source == "rig" and error.field.endswith("seam_rad")
    assert error.value == "left" and error.field in str(error) and error.expectation in str(error)
    assert pickle.loads(pickle.dumps(error)).field == error.field


def test_a_rig_of_keywords_is_that_of_the_file(rig):
    marker, camera = rig.instruments[0].marker, rig.camera
    again = lapservo.Rig(
        lapservo.Camera(camera.width_px, camera.height_px, camera.matrix, distortion=camera.distortion,
                        response=camera.response),
        [lapservo.Instrument("PSM1", lapservo.Marker(
            diameter_m=marker.diameter_m, bands_upper_m=marker.bands_upper_m, bands_lower_m=marker.bands_lower_m,
            hues_deg=marker.hues_deg, seam_rad=marker.seam_rad),
            camera_from_rcm=rig.instruments[0].camera_from_rcm)])
    assert np.allclose(lapservo.Kinematics(again).features(Q), lapservo.Kinematics(rig).features(Q), atol=1e-9)


def test_kinematics_round_trip_and_differentiate(rig):
    kinematics, step, compared = lapservo.Kinematics(rig), 1e-6, 0
    for q in np.random.default_rng(1).uniform([-0.3, 1.3, 0.05, -3], [0.3, 1.8, 0.08, 3], (50, 4)):
        f, jacobian = kinematics.features(q), kinematics.jacobian(q)
        near = [kinematics.features(q + sign * d) for d in step * np.eye(4) for sign in (1, -1)]
        if f is None or any(each is None for each in near) or abs(np.linalg.det(jacobian)) < 1:
            continue
        change = np.subtract(near[::2], near[1::2]).T
        if np.any(np.abs(change) > 1):
            continue  # across the seam
        assert np.allclose(jacobian, change / (2 * step), rtol=1e-4, atol=1e-2)
        found = kinematics.inverse(f, q + 1e-4)
        assert found is None or np.allclose(kinematics.features(found), f, atol=1e-6)
        compared += 1
    assert compared > 20


def test_a_cross_ratio_decodes(rig):
    marker = rig.instruments[0].marker
    for tau in np.linspace(0.02, 6.26, 50):
        assert marker.decode(marker.cross_ratio(tau)) == pytest.approx(tau, abs=1e-9)


def test_a_marker_is_designed_and_printed(tmp_path):
    marker = lapservo.design_marker(0.005, focal_px=1100, distance_m=0.1)
    assert marker.diameter_m == 0.005 and marker.length_m == pytest.approx(0.015)
    lapservo.print_marker(tmp_path / "m.pdf", marker, copies=2)
    assert (tmp_path / "m.pdf").read_bytes().startswith(b"%PDF")
    with pytest.raises(lapservo.InputError):
        lapservo.print_marker(tmp_path / "m.doc", marker)
    with pytest.raises(lapservo.InputError):
        lapservo.design_marker(0.005, length_m=0.001)


def test_the_rcm_is_where_lines_meet(rig):
    renderer, tracker = lapservo.Renderer(rig), lapservo.Tracker(free(rig), single=True)
    seen = []
    for theta in np.linspace(-0.3, 0.3, 9):
        seen += tracker.track(renderer.render([theta, 1.5, 0.064, 1.0]))
    estimate = lapservo.estimate_rcm(seen)
    truth = rig.camera.matrix @ rig.instruments[0].camera_from_rcm[:3, 3]
    off = estimate.point_px - truth[:2] / truth[2]
    assert estimate.status == "ok" and estimate.lines >= 6
    assert np.linalg.norm(off) < 30 and off @ np.linalg.solve(estimate.covariance_px2, off) < 20
    assert lapservo.estimate_rcm(seen[:1]).point_px is None
    other = lapservo.Rig(rig.camera, [lapservo.Instrument("PSM2", rig.instruments[0].marker)])
    with pytest.raises(lapservo.InputError, match="of PSM1 and PSM2, expected those of one instrument"):
        lapservo.estimate_rcm(seen + lapservo.Tracker(other).track(renderer.render(Q)))


class Arm(lapservo.Robot):
    def __init__(self, simulator):
        super().__init__()
        self.simulator, self.sent = simulator, 0

    def state(self):
        return self.simulator.state()

    def readings(self):
        return self.simulator.readings()

    def send(self, path):
        assert len(path.at(self.simulator.now_s())) == 2
        self.sent += 1
        self.simulator.send(path)

    def is_simulated(self):
        return True


class Eye(lapservo.ImageStream):
    def __init__(self, simulator):
        super().__init__()
        self.simulator = simulator

    def newest(self):
        return self.simulator.newest()


class Time(lapservo.Clock):
    def __init__(self, simulator):
        super().__init__()
        self.simulator = simulator

    def now_s(self):
        return self.simulator.now_s()

    def sleep_until(self, time_s):
        self.simulator.sleep_until(time_s)


def errors_of_a_run(rig, robot, images, clock, duration_s=2.5):
    errors = []
    target = lapservo.set_point(lapservo.Kinematics(rig).features(Q) + [0.02, 10, 5, 5])
    lapservo.run(robot, images, clock, rig, target, duration_s,
                 on_tick=lambda tick: errors.append(tick.error) if tick.error is not None else None)
    return np.array(errors)


def test_ports_in_python_do_what_the_simulators_do(rig):
    simulator = lapservo.Simulator(rig, Q, seed=4)
    errors = errors_of_a_run(rig, simulator, simulator, simulator)
    assert np.all(np.abs(errors[-1]) < [0.005, 1, 1, 1])
    simulator = lapservo.Simulator(rig, Q, seed=4)
    arm = Arm(simulator)
    assert np.array_equal(errors_of_a_run(rig, arm, Eye(simulator), Time(simulator)), errors)
    assert arm.sent > 100


def test_a_port_whose_overrides_nobody_calls_has_no_subclasses():
    ports = lapservo.Robot, lapservo.ImageStream, lapservo.Clock
    made = [thing for thing in vars(lapservo).values()
            if isinstance(thing, type) and issubclass(thing, ports) and thing not in ports]
    assert len(made) in (2, 4)  # without ROS 2, with it
    for each in made:
        with pytest.raises(TypeError, match=f"subclass of {each.__name__}: subclass .*, and pass calls on to a "):
            type("Guarded", (each,), {})


@pytest.mark.parametrize("event", ["second_camera", "loop_late"])
def test_what_a_port_in_python_passes_on_holds_until_a_start(rig, event):
    class Passed(Eye):
        def take_second_sender(self):
            return event == "second_camera" and self.simulator.now_s() > 0.5

    class Suspended(Time):
        def suspended_s(self):
            return float(event == "loop_late" and self.simulator.now_s() > 0.5)

    simulator, blocked = lapservo.Simulator(rig, Q), []
    assert not simulator.take_second_sender() and simulator.suspended_s() == 0
    lapservo.run(Arm(simulator), Passed(simulator), Suspended(simulator), rig,
                 lapservo.set_point(lapservo.Kinematics(rig).features(Q)), 1,
                 on_tick=lambda tick: blocked.append(tick.joints.blocked))
    assert blocked[20] == "none" and blocked[-1] == event


def test_what_a_port_raises_leaves_the_run(rig):
    class Broken(Arm):
        def state(self):
            raise ZeroDivisionError("the arm's driver")

    class Stuck(Arm):
        def release(self):
            raise ZeroDivisionError("the arm's driver")

    for robot in (Broken, Stuck):
        simulator = lapservo.Simulator(rig, Q)
        begin_s = simulator.now_s()
        with pytest.raises(ZeroDivisionError, match="the arm's driver"):
            errors_of_a_run(rig, robot(simulator), simulator, simulator, 0.5)
    assert simulator.now_s() - begin_s > 0.7  # the rest was waited for

    class Empty(lapservo.Robot):
        def is_simulated(self):
            return True

    with pytest.raises(RuntimeError, match="pure virtual"):
        errors_of_a_run(rig, Empty(), simulator, simulator)


def test_a_run_ends_when_told(rig):
    simulator, ticks = lapservo.Simulator(rig, Q), []

    def on_tick(tick):
        ticks.append(tick)
        return len(ticks) < 20

    lapservo.run(simulator, simulator, simulator, rig, lapservo.paper_trajectory(), 60, on_tick=on_tick)
    assert len(ticks) == 20 and simulator.now_s() < 5
    seen = [tick for tick in ticks if tick.image is not None]
    assert seen and seen[0].observations[0].ok and seen[0].image.shape == (720, 1280, 3)
    with pytest.raises(ValueError, match="read-only"):
        seen[0].image[0, 0] = 0
    assert ticks[0].action == "hold" and ticks[0].hold_reason == "no_image_yet" and ticks[0].error is None


def test_the_uncalibrated_loop_goes_by_rcm_px_alone_and_no_other_takes_it(rig):
    simulator, seen = lapservo.Simulator(rig, Q), []
    uncalibrated = lapservo.Controller(rig, mode="uncalibrated")
    goal = lapservo.set_point(lapservo.Kinematics(rig).features(Q))
    lapservo.run(simulator, simulator, simulator, rig, goal, 0.5, controller=uncalibrated, rcm_px=[640, -600],
                 on_tick=lambda tick: seen.extend(tick.observations))
    assert any(each.ok for each in seen) and all(each.q is None for each in seen)
    for of, given in ((rig, {"rcm_px": [640, -600]}), (free(rig), {"controller": uncalibrated})):
        with pytest.raises(lapservo.InputError, match="run: rcm_px"):
            lapservo.run(simulator, simulator, simulator, of, goal, 1, **given)


def test_clocks_that_are_not_the_loops_are_refused(rig):
    class Ahead(Arm):
        def state(self):
            return lapservo.JointState(1e9, Q)

    simulator = lapservo.Simulator(rig, Q)
    with pytest.raises(lapservo.InputError, match="JointState: time_s: is 1000000000.000, expected a time of the loop's"):
        errors_of_a_run(rig, Ahead(simulator), simulator, simulator)
    with pytest.raises(lapservo.InputError, match="duration_s: is nan"):
        errors_of_a_run(rig, simulator, simulator, simulator, float("nan"))


def test_a_covered_marker_makes_it_hold(rig):
    simulator, reasons = lapservo.Simulator(rig, Q), []
    simulator.cover_marker(0.6, 2)
    lapservo.run(simulator, simulator, simulator, rig, lapservo.set_point(lapservo.Kinematics(rig).features(Q)), 1.2,
                 on_tick=lambda tick: reasons.append(tick.hold_reason))
    assert "none" in reasons and reasons[-1] == "marker_lost"


def test_trajectories(tmp_path):
    wave = lapservo.sinusoids([1, 2, 3, 4], [0.1, 0.2, 0.3, 0.4], [1, 1, 1, 1])
    f, rate, acceleration = wave.at(0.5)
    own = lapservo.Trajectory(3.0, lambda t: wave.at(t))
    assert np.array_equal(own.at(0.5)[0], f) and own.duration_s == 3
    assert np.allclose((wave.at(0.5 + 1e-6)[0] - f) / 1e-6, rate, atol=1e-5)
    path = lapservo.via_points([[0, 1, 2, 3], [1, 2, 3, 4]], [1, 1, 1, 1])
    assert np.allclose(path.at(path.duration_s)[0], [1, 2, 3, 4])
    with pytest.raises(lapservo.InputError):
        lapservo.load_trajectory(tmp_path / "none.csv")


def test_a_controller_says_what_a_file_can(rig, tmp_path):
    controller = lapservo.Controller(rig, mode="paper", period_s=1 / 30, delay_s=0.05)
    assert controller.mode == "paper" and "delay_s: 0.05" in controller.to_yaml()
    fused = lapservo.Controller(rig, mode="fused")
    assert fused.mode == "fused" and "mode: fused" in fused.to_yaml() and "fused" in repr(fused)
    assert lapservo.Controller(rig, mode="default").mode == "fused"
    (tmp_path / "controller.yaml").write_text(fused.to_yaml())
    assert lapservo.Controller(rig, path=tmp_path / "controller.yaml").to_yaml() == fused.to_yaml()
    with pytest.raises(lapservo.InputError) as caught:
        lapservo.Controller(rig, mode="fast")
    assert caught.value.field == "mode"


def with_shifted_joints(rig):
    own = rig.instruments[0]
    joints = lapservo.Joints(own.joints.names, sign=own.joints.sign, offset=np.add(own.joints.offset, [0, 0, 0.02, 0]))
    return lapservo.Rig(rig.camera, [lapservo.Instrument(own.name, own.marker, camera_from_rcm=own.camera_from_rcm,
                                                         joints=joints)])


def test_a_controller_steers_the_rig_of_which_it_is_made(rig):
    camera = lapservo.Camera(rig.camera.width_px, rig.camera.height_px, rig.camera.matrix + np.diag([1, 0, 0]))
    limits = [[-1, 0.6, 0.03, -4], [1, 2.5, 0.2, 4], [0.4, 0.4, 0.04, 1.5], [2, 2, 0.2, 7.5]]
    controller, simulator = lapservo.Controller(rig, joint_limits=limits), lapservo.Simulator(rig, Q)
    for other, field in ((lapservo.Rig(camera, rig.instruments), "rig.camera"),
                         (with_shifted_joints(rig), "rig.instruments[0].joints")):
        with pytest.raises(lapservo.InputError) as caught:
            lapservo.run(simulator, simulator, simulator, other, lapservo.paper_trajectory(), 1, controller=controller)
        assert caught.value.source == "run" and caught.value.field == field


def test_a_robot_and_a_camera_are_in_one_run_at_a_time(rig):
    simulator, other, goal = lapservo.Simulator(rig, Q), lapservo.Simulator(rig, Q), lapservo.paper_trajectory()

    def on_tick(tick):
        for robot, images, field in ((simulator, other, "robot"), (other, simulator, "images")):
            with pytest.raises(lapservo.InputError, match=f"run: {field}: is in another run"):
                lapservo.run(robot, images, other, rig, goal, 1)
        return False

    for _ in range(2):
        lapservo.run(simulator, simulator, simulator, rig, goal, 1, on_tick=on_tick)


SCRIPT = """
from test_lapservo import *

class Announced(Arm):
    def release(self):
        print("released", flush=True)

rig, moving = lapservo.Rig.load(SOURCE / "configs" / "paper.yaml"), threading.Event()
simulator = lapservo.Simulator(rig, Q)
signal.signal(signal.SIGHUP, signal.SIG_DFL)  # also under nohup

def on_tick(tick):
    if tick.sent and not moving.is_set():
        print("moving", flush=True)
        moving.set()

def go():
    goal = lapservo.set_point(lapservo.Kinematics(rig).features(Q))
    lapservo.run(Announced(simulator), simulator, simulator, rig, goal, 600, on_tick=on_tick)

"""


@pytest.mark.parametrize(("ending", "sent", "code"), [
    ("go()", signal.SIGTERM, -signal.SIGTERM),
    ("go()", signal.SIGHUP, -signal.SIGHUP),
    ("threading.Thread(target=go).start(); threading.Event().wait()", signal.SIGTERM, -signal.SIGTERM),
    ("threading.Thread(target=go).start(); moving.wait()", None, 0),
    ("threading.Thread(target=go, daemon=True).start(); moving.wait()", None, 0),
])
def test_every_end_of_the_process_brakes_first(ending, sent, code):
    process = subprocess.Popen([sys.executable, "-c", SCRIPT + ending], cwd=SOURCE / "python" / "tests",
                               stdout=subprocess.PIPE, text=True)
    assert process.stdout.readline() == "moving\n"
    if sent:
        process.send_signal(sent)
    assert process.stdout.read() == "released\n" and process.wait(timeout=120) == code
