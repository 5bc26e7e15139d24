"""Arrays as they come: taken, or refused by an InputError of one line that names the argument."""

import numpy as np
import pytest
from conftest import Q

import lapservo

K = np.array([[1000, 0, 640], [0, 1000, 360], [0, 0, 1.0]])
MARKER = {"diameter_m": 0.0083, "bands_upper_m": [0.0035, 0.0035, 0.017], "bands_lower_m": [0.017, 0.0035, 0.0035]}


def refused(call, *arguments, **keywords):
    with pytest.raises(lapservo.InputError) as caught:
        call(*arguments, **keywords)
    text = str(caught.value)
    assert "\n" not in text and len(text) < 250 and "array(" not in text
    return caught.value


PICTURES = [
    (lambda i: None, "type", "None"),
    (lambda i: i.tolist(), "type", "list"),
    (lambda i: "frame.png", "type", "str"),
    (lambda i: i / 255.0, "dtype", "float64"),
    (lambda i: i.astype(np.float32), "dtype", "float32"),
    (lambda i: i.astype(np.uint16) * 256, "dtype", "uint16"),
    (lambda i: i.astype(np.int8), "dtype", "int8"),
    (lambda i: i > 128, "dtype", "bool"),
    (lambda i: i.astype(object), "dtype", "object"),
    (lambda i: i[0], "shape", "[1280, 3]"),
    (lambda i: i[:, :, 0], "shape", "[720, 1280]"),
    (lambda i: i[:, :, :2], "shape", "[720, 1280, 2]"),
    (lambda i: np.dstack([i, i[:, :, :1]]), "shape", "[720, 1280, 4]"),
    (lambda i: i.transpose(2, 0, 1), "shape", "[3, 720, 1280]"),
    (lambda i: i[None], "shape", "[1, 720, 1280, 3]"),
    (lambda i: i[:0], "shape", "[0, 1280, 3]"),
    (lambda i: i[:, ::2], "strides", "[3840, 6, 1]"),
    (lambda i: i[:, :, ::-1], "strides", "[3840, 3, -1]"),  # RGB of BGR and back
    (lambda i: i[::-1], "strides", "[-3840, 3, 1]"),
    (lambda i: np.asfortranarray(i), "strides", "[1, 720, 921600]"),
    (lambda i: i[:-1], "size", "1280x719"),
]


@pytest.mark.parametrize(("make", "field", "value"), PICTURES)
def test_other_pictures_are_refused(rig, image, make, field, value):
    picture, tracker = make(image), lapservo.Tracker(rig)
    error = refused(tracker.track, picture)
    assert (error.source, error.field, error.value) == ("image", field, value) and "expected" in str(error)
    if field == "size":
        return
    seen = tracker.track(image)[0]
    for call in (seen.overlay, lapservo.Picture):
        assert refused(call, picture).field == field

    class Eye(lapservo.ImageStream):
        def newest(self):
            return 0.0, picture

    error = refused(lapservo.ImageStream.newest, Eye())
    assert (error.source, error.field, error.value) == ("ImageStream.newest()", field, value)


def test_pictures_may_be_read_only_and_their_rows_apart(rig, image):
    wide = np.zeros((720, 1400, 3), np.uint8)
    wide[:, :1280] = image
    wide.setflags(write=False)
    turned = np.ascontiguousarray(image[:, :, ::-1])[:, :, ::-1]
    seen = [lapservo.Tracker(rig).track(i)[0] for i in (image, wide[:, :1280], np.ascontiguousarray(turned))]
    assert all(np.array_equal(seen[0].q, each.q) for each in seen)


@pytest.mark.parametrize("stamp", [float("nan"), float("inf"), "now", [1.0, 2.0], np.zeros(3)])
def test_a_stamp_is_a_finite_number(rig, image, stamp):
    assert refused(lapservo.Tracker(rig).track, image, stamp).source == "stamp_s"
    assert lapservo.Tracker(rig).track(image, np.float32(0.5))[0].stamp_s == 0.5


def test_of_a_camera_in_python_a_wrong_pair_is_refused(rig):
    class Eye(lapservo.ImageStream):
        def newest(self):
            return np.zeros((720, 1280, 3), np.uint8)

    assert refused(lapservo.ImageStream.newest, Eye()).expectation == "(time_s, uint8[H, W, 3]) or None"


FOUR = [
    (None, "type"), ("four", "dtype"), (object(), "dtype"), ([[1, 2], [3]], None), (3.0, "shape"), ([1, 2, 3], "shape"),
    (np.zeros((2, 2)), "shape"), (np.zeros((5, 5)), "shape"), (np.zeros(4, complex), "dtype"), ([1, 2, 3, None], "dtype"),
    ([1, 2, 3, "4"], "dtype"), ([1, 2, 3, float("nan")], "value"), ([1, 2, 3, float("inf")], "value"),
]


@pytest.mark.parametrize(("given", "field"), FOUR)
def test_four_numbers_are_four_finite_numbers(rig, given, field):
    kinematics, instrument = lapservo.Kinematics(rig), rig.instruments[0]
    calls = {
        "q": [kinematics.features, kinematics.jacobian, lapservo.Renderer(rig).render,
              lambda q: lapservo.camera_from_marker(instrument, q), lambda q: lapservo.Simulator(rig, q)],
        "guess": [lambda guess: kinematics.inverse(Q, guess)],
        "features": [lapservo.set_point, lambda features: kinematics.inverse(features, Q)],
        "amplitude": [lambda amplitude: lapservo.sinusoids(Q, amplitude, Q)],
        "max_rate": [lambda rate: lapservo.via_points([Q, Q], rate)],
        "backlash": [lambda backlash: lapservo.Simulator(rig, Q, backlash=backlash)],
        "offset": [lambda offset: lapservo.Joints(list("abcd"), offset=offset)],
    }
    for name, every in calls.items():
        for call in every:
            error = refused(call, given)
            assert error.source == name
            assert error.field == (field or error.field)


@pytest.mark.parametrize("shape", [(4,), (1, 4), (4, 1)])
@pytest.mark.parametrize("dtype", [np.float64, np.float32, np.float16, np.int64, ">f8"])
def test_a_vector_may_lie_as_it_likes(rig, shape, dtype):
    q = np.array([0, 2, 0, 1]).astype(dtype).reshape(shape)
    state = lapservo.JointState(0, q)
    assert state.q.tolist() == [0, 2, 0, 1]
    assert np.array_equal(lapservo.set_point(q).at(0)[0], [0, 2, 0, 1])
    spaced = np.zeros((4, 8))
    spaced[:, 0] = Q
    assert np.array_equal(lapservo.Kinematics(rig).features(spaced[:, 0]), lapservo.Kinematics(rig).features(Q))
    assert np.isnan(lapservo.JointState(0, [0, 1, 2, float("nan")]).q[3])  # the loop holds


@pytest.mark.parametrize("distortion", [[], [-0.1, 0.02, 0.001, -0.002], [-0.1, 0.02, 0.001, -0.002, 0],
                                        [-0.1, 0.02, 0.001, -0.002, 0, 0, 0, 0], [-0.1, 0.02, 0.001, -0.002] + 10 * [0]])
@pytest.mark.parametrize("shape", [(-1,), (1, -1), (-1, 1)])
def test_distortion_is_taken_as_opencv_and_files_have_it(distortion, shape):
    camera = lapservo.Camera(1280, 720, K, distortion=np.array(distortion, float).reshape(shape))
    assert camera.distortion == tuple((distortion + 5 * [0])[:5])


@pytest.mark.parametrize(("distortion", "expected"), [
    ([0, 0, 0], "k1 k2 p1 p2 k3, of which k3 or all may be left out, or k4 k5 k6 of 0 follow"),
    (6 * [0], "k1 k2 p1 p2 k3, of which k3 or all may be left out, or k4 k5 k6 of 0 follow"),
    ([0, 0, 0, 0, 0, 0.1, 0, 0], "k4 k5 k6 of 0: a rational lens is not modelled (lapservo calibrate camera fits plumb_bob)"),
    ([0, 0, 0, 0, float("nan")], "float[N] of finite numbers"), (np.zeros((2, 2)), "float[N]"), (None, "float[N]"),
])
def test_other_distortion_is_refused_as_in_files(distortion, expected):
    assert refused(lapservo.Camera, 1280, 720, K, distortion=distortion).expectation == expected


def test_poses_are_3_x_4_or_4_x_4(rig):
    marker, pose = rig.instruments[0].marker, rig.instruments[0].camera_from_rcm
    for given in (pose, pose[:3], pose.tolist(), np.asfortranarray(pose), pose.astype(np.float32)):
        assert np.allclose(lapservo.Instrument("x", marker, camera_from_rcm=given).camera_from_rcm, pose, atol=1e-6)
    mirrored = pose @ np.diag([1, 1, -1, 1.0])
    last = np.vstack([pose[:3], [0, 0, 1, 1]])
    for given in (np.diag([1, 1, 2, 1.0]), mirrored, last, pose[:3, :3], pose[:2], pose[None], pose * np.nan, "pose", 4):
        assert refused(lapservo.Instrument, "x", marker, camera_from_rcm=given).source == "camera_from_rcm"


def test_other_arrays_of_a_rig_are_refused():
    for given in (None, K[:2], K.ravel(), K.astype(str), K * np.nan):
        assert refused(lapservo.Camera, 1280, 720, given).source == "matrix"
    assert refused(lapservo.Camera, 1280, 720, np.ones((3, 3))).field == "matrix"
    for name in ("bands_upper_m", "bands_lower_m", "hues_deg"):
        for given in (None, [1, 2], "abc", np.full(3, np.nan)):
            assert refused(lapservo.Marker, **MARKER | {name: given}).source == name
    camera = lapservo.Camera(1280, 720, K)
    for given in (None, [1, 2, 3], ["u", "v"]):
        assert refused(camera.ideal_from_raw, given).source == "raw_px"
        assert refused(camera.raw_from_ideal, given).source == "ideal_px"


def test_tables_have_rows_of_four(rig):
    points = np.array([[0, 1, 2, 3], [1, 2, 3, 4.0]])
    for given in (points, points.tolist(), np.asfortranarray(points)):
        path = lapservo.via_points(given, [1, 1, 1, 1])
        assert np.allclose(path.at(path.duration_s)[0], points[1])
    for given in (None, points.T, points[None], [[1, 2, 3, 4], [1]], points * np.nan):
        assert refused(lapservo.via_points, given, [1, 1, 1, 1]).source == "points"
    assert refused(lapservo.Renderer(rig).render, np.array([Q, Q])).value == "2 configurations"


def test_what_a_trajectory_or_arm_in_python_gives_is_refused_by_name(rig):
    for given in ((Q, Q), (Q, Q, Q[:3]), None, 3):
        assert refused(lapservo.Trajectory(1, lambda t: given).at, 0).source == "Trajectory.at()"

    class Arm(lapservo.Robot):
        def readings(self):
            return [(0.0, Q[:3])]

        def state(self):
            return lapservo.JointState(0, Q)

    simulator = lapservo.Simulator(rig, Q)
    goal = lapservo.set_point(lapservo.Kinematics(rig).features(Q))
    assert refused(lapservo.run, Arm(), simulator, simulator, rig, goal, 1).field == "arm_limits"
    for given in ([[-1] * 4] * 3, [[-1] * 3] * 4, [[-1, np.nan, 0, 0]] * 4, 3):
        assert refused(lapservo.Controller, rig, joint_limits=given).source == "joint_limits"
    degrees = [[-57, 0, 0, -229], [57, 143, 70, 229], [0.4, 0.4, 0.04, 1.5], [2, 2, 0.2, 7.5]]
    assert "57 looks like degrees" in refused(lapservo.Controller, rig, joint_limits=degrees).expectation
    limits = [[-1, 0.6, 0.03, -4], [1, 2.5, 0.2, 4], [0.4, 0.4, 0.04, 1.5], [2, 2, 0.2, 7.5]]
    controller = lapservo.Controller(rig, joint_limits=limits)
    assert refused(lapservo.run, Arm(), simulator, simulator, rig, goal, 1, controller=controller).source == "Robot.readings()"
    Arm.readings = lambda self: None
    assert refused(lapservo.run, Arm(), simulator, simulator, rig, goal, 1, controller=controller).source == "Robot.readings()"
    del Arm.readings
    Arm.state = lambda self: None
    assert refused(lapservo.run, Arm(), simulator, simulator, rig, goal, 1, controller=controller).source == "Robot.state()"
