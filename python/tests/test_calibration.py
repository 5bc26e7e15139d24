"""Calibrations: the same rig, byte for byte, as the command line writes, by paths and by arrays."""

import pickle
import shutil
import signal
import struct
import subprocess
import zlib

import numpy as np
import pytest
from recordings import DELAY_S, FPS, TOOL, Recordings, swinging, turning

import lapservo


@pytest.fixture(scope="module")
def recordings(tmp_path_factory):
    return Recordings(tmp_path_factory.mktemp("recordings"))


@pytest.fixture(scope="module")
def swing(recordings):
    return recordings.record("swing", swinging, 72)


def expect_whole(result, rig):
    """The common fields of all results: a rig to go on with, numbers, what a notebook shows, a pickle."""
    assert lapservo.Rig.parse(result.yaml).to_yaml() == result.rig.to_yaml()
    assert result.numbers and all(np.isfinite([n.after, n.sigma]).all() for n in result.numbers)
    assert result._repr_html_().count("<tr>") == len(result.numbers) + 1
    again = pickle.loads(pickle.dumps(result))
    assert again.yaml == result.yaml and repr(again.numbers) == repr(result.numbers) and type(again) is type(result)
    assert lapservo.Tracker(result.rig) and [i.name for i in result.rig.instruments] == [i.name for i in rig.instruments]


def test_a_registration_is_the_command_lines(recordings, swing):
    images, joints = swing
    text = (recordings.folder / "rig.yaml").read_text()
    path = recordings.folder / "unregistered.yaml"
    path.write_text(text[:text.index("    camera_from_rcm")] + text[text.index("    joints"):text.index("    image_delay_s")])
    commanded = recordings.commanded("registration", "swing", "--fps", str(FPS), "--joints", "swing_joints.csv", "--rig",
                                     path.name)
    told = []
    result = lapservo.calibrate_registration(images, path, joints=joints, fps=FPS, progress=lambda *a: told.append(a))
    assert recordings.saved(result) == commanded
    assert told[71] == (72, 72, ", PSM1 in 72")
    expect_whole(result, recordings.rig)
    assert np.allclose(result.camera_from_rcm[:3, 3], recordings.rig.instruments[0].camera_from_rcm[:3, 3], atol=5e-4)
    assert result.image_delay_s == pytest.approx(DELAY_S, abs=5e-3) and result.residuals.shape == (72, 4)
    assert result.joints.names == ("yaw", "pitch", "insertion", "roll") and set(result.joints.sign) == {1}


def test_colours_are_the_command_lines(recordings, swing):
    images, _ = swing
    text = (recordings.folder / "rig.yaml").read_text()
    path = recordings.folder / "pale.yaml"
    hues = recordings.rig.instruments[0].marker.hues_deg
    path.write_text(text.replace("hues_deg: [{:g}, {:g}, {:g}]".format(*hues), "hues_deg: [{:g}, {:g}, {:g}]".format(
        *(hue + 15 for hue in hues))))
    assert path.read_text() != text
    commanded = recordings.commanded("colour", "swing", "--fps", str(FPS), "--rig", path.name)
    result = lapservo.calibrate_colour(recordings.folder / "swing", path, fps=FPS)
    assert recordings.saved(result) == commanded
    expect_whole(result, recordings.rig)
    of_arrays = lapservo.calibrate_colour((image for image in images), lapservo.Rig.load(path), fps=FPS)
    assert of_arrays.numbers == result.numbers and of_arrays.rig.to_yaml() == result.rig.to_yaml()
    assert np.allclose(result.hues_deg, hues, atol=4) and result.found >= result.found_before


def test_a_measured_response_stays_that_of_a_rig(recordings, swing):
    images, _ = swing
    camera, instruments = recordings.rig.camera, recordings.rig.instruments
    assert camera.sigma_response is None and "sigma_response" not in recordings.rig.to_yaml()
    measured = lapservo.Camera(camera.width_px, camera.height_px, camera.matrix, response=1.7, sigma_response=0.003)
    path = recordings.folder / "measured.yaml"
    lapservo.Rig(measured, instruments).save(path)
    commanded = recordings.commanded("colour", "swing", "--fps", str(FPS), "--rig", path.name)
    loaded = lapservo.Rig.load(path)
    for rig in (loaded, lapservo.Rig(loaded.camera, loaded.instruments), pickle.loads(pickle.dumps(loaded)),
                lapservo.Rig(pickle.loads(pickle.dumps(loaded.camera)), instruments), lapservo.Rig.parse(loaded.to_yaml())):
        assert rig.camera.sigma_response == 0.003 and rig.to_yaml() == path.read_text()
    kept = lapservo.calibrate_colour(images, loaded, fps=FPS)
    assert kept.rig.camera.response == 1.7 and kept.rig.camera.sigma_response == 0.003
    assert kept.rig.to_yaml() == lapservo.Rig.parse(commanded.decode()).to_yaml()
    again = lapservo.calibrate_colour(images, kept.rig, fps=FPS)
    assert again.rig.camera.response == 1.7
    replaced = lapservo.calibrate_colour(images, loaded, fps=FPS, replace_response=True)
    assert replaced.rig.camera.response == "srgb" and replaced.rig.camera.sigma_response is None
    assert refused(lapservo.Camera, 4, 4, np.eye(3), sigma_response=-1).field == "sigma_response"


def test_a_print_is_the_command_lines(recordings):
    images, joints = recordings.record("turn", turning, 48)
    path = recordings.folder / "rig.yaml"
    commanded = recordings.commanded("marker", "turn", "--fps", str(FPS), "--joints", "turn_joints.csv", "--rig", path.name)
    result = lapservo.calibrate_marker([(i / FPS, image) for i, image in enumerate(images)], path, joints=joints)
    assert recordings.saved(result) == commanded
    expect_whole(result, recordings.rig)
    assert result.found == 48 and np.allclose(result.marker.bands_upper_m, recordings.rig.instruments[0].marker.bands_upper_m,
                                              atol=5e-5)
    assert set(result.marker.sigmas) >= {"bands_upper_m", "wrap_m", "gap_rad", "seam_rad"}
    assert result.seam_may_lag is False


@pytest.fixture(scope="module")
def boards(sample):
    return [lapservo.read_image(path) for path in sorted((sample / "boards").iterdir())]


def test_a_camera_is_the_command_lines(sample, boards, tmp_path):
    rig = lapservo.Rig.load(sample / "truth.yaml")
    subprocess.run([TOOL, "calibrate", "camera", sample / "boards", "--board", "9x6", "--square-mm", "5", "--rig",
                    sample / "truth.yaml", "--out", tmp_path / "commanded.yaml"], check=True, capture_output=True)
    result = lapservo.calibrate_camera(boards, "9x6", 0.005, rig=sample / "truth.yaml")
    result.save(tmp_path / "saved.yaml")
    assert (tmp_path / "saved.yaml").read_bytes() == (tmp_path / "commanded.yaml").read_bytes()
    expect_whole(result, rig)
    assert result.camera.matrix[0, 0] == pytest.approx(rig.camera.matrix[0, 0], rel=1e-3) and len(result.views) == 12
    assert np.array_equal(pickle.loads(pickle.dumps(result)).camera.matrix, result.camera.matrix)


@pytest.mark.skipif(not shutil.which("ffmpeg"), reason="no ffmpeg")
def test_each_recording_of_a_board_says_what_is_wrong_with_it(sample, tmp_path):
    cut, whole = tmp_path / "cut.mkv", tmp_path / "whole.mkv"
    subprocess.run(["ffmpeg", "-v", "error", "-framerate", "1", "-pattern_type", "glob", "-i", sample / "boards" / "*.png",
                    "-c:v", "ffv1", whole], check=True)
    cut.write_bytes(whole.read_bytes()[:whole.stat().st_size * 4 // 5])
    result = lapservo.calibrate_camera([cut, whole], "9x6", 0.005)
    assert result.complaint.startswith(f"{cut}: ends early") and str(whole) not in result.complaint
    rig = lapservo.Rig.load(sample / "truth.yaml")
    for read in (False, True):
        frame = next(lapservo.open_frames(whole, deinterlaced=read))
        assert lapservo.Tracker(rig, deinterlace=read).track(frame)
        assert refused(lapservo.Tracker(rig, deinterlace=not read).track, frame).field == "deinterlaced"
        assert refused(lapservo.calibrate_marker, [frame], rig, deinterlace=not read).field == "deinterlaced"


def test_a_cameras_own_file_is_named_from_anywhere_and_never_written_over(recordings, swing, monkeypatch):
    images, _ = swing
    home, elsewhere = recordings.folder / "home", recordings.folder / "elsewhere"
    for folder in (home / "lens", elsewhere):
        folder.mkdir(parents=True)
    lines = recordings.rig.to_yaml().splitlines()
    instruments = lines.index("instruments:")
    lens = home / "lens" / "camera.yaml"
    lens.write_text("".join(f"{line[2:]}\n" for line in lines[1:instruments]) + "sigma_response: 0.003\n")
    (home / "rig.yaml").write_text("\n".join(["camera: lens/camera.yaml", *lines[instruments:], ""]))
    monkeypatch.chdir(home)
    result = lapservo.calibrate_colour(images[:12], "rig.yaml", fps=FPS)
    monkeypatch.chdir(elsewhere)
    result.save("saved.yaml")
    assert "camera: ../home/lens/camera.yaml" in (elsewhere / "saved.yaml").read_text()
    assert lapservo.Rig.load("saved.yaml").to_yaml() == result.rig.to_yaml()
    (elsewhere / "link.yaml").symlink_to(lens)
    before = lens.read_bytes()
    for path in (lens, "../home/lens/camera.yaml", "link.yaml"):
        assert "the file of a camera" in refused(result.save, path).problem
        assert refused(lapservo.calibrate_colour(images[:12], lapservo.Rig.load(home / "rig.yaml"), fps=FPS).save, path)
    monkeypatch.chdir(home)
    loaded = lapservo.Rig.load("rig.yaml")
    monkeypatch.chdir(elsewhere)
    for rig in (loaded, pickle.loads(pickle.dumps(loaded))):
        assert refused(lapservo.calibrate_colour(images[:12], rig, fps=FPS).save, lens)
        assert refused(rig.save, lens) and refused(lapservo.Rig(rig.camera, rig.instruments).save, lens)
    assert lens.read_bytes() == before


def test_a_camera_alone_replaces_no_rig(sample, tmp_path):
    shutil.copy(sample / "rig.yaml", tmp_path / "rig.yaml")
    result = lapservo.calibrate_camera(sample / "boards", "9x6", 0.005)
    assert "is a rig" in refused(result.save, tmp_path / "rig.yaml").problem
    result.save(tmp_path / "camera.yaml")


def test_a_fit_asks_for_signals(boards):
    asked = []
    before = signal.signal(signal.SIGALRM, lambda *_: asked.append(True))
    signal.setitimer(signal.ITIMER_REAL, 1e-3, 1e-3)
    try:
        lapservo.calibrate_camera(boards[:6], "9x6", 0.005)
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)
    assert len(asked) > 20  # six images alone would be looked at some ten times


def refused(call, *arguments, **keywords):
    with pytest.raises(lapservo.InputError) as caught:
        call(*arguments, **keywords)
    return caught.value


def test_what_does_not_tell_is_refused(recordings, rig):
    grey = np.full((rig.camera.height_px, rig.camera.width_px, 3), 90, np.uint8)
    error = refused(lapservo.calibrate_marker, [grey] * 2, rig)
    assert error.source == "frames" and error.problem.startswith("PSM1 is in none of 2 frames")
    assert "PSM1 is in none" in refused(lapservo.calibrate_registration, [grey], rig).problem
    assert "at least" in refused(lapservo.calibrate_colour, [grey], rig).problem
    assert "the board is in none of 1 images" in refused(lapservo.calibrate_camera, [grey], "9x6", 0.005).problem
    # As the command line has it, with its own words for the options.
    assert refused(lapservo.calibrate_camera, [grey], "9", 0.005).field == "corners"
    assert refused(lapservo.calibrate_marker, [grey], rig, instrument="PSM9").value == "PSM9"
    small = refused(lapservo.calibrate_colour, [grey[:100]], rig)
    assert (small.field, small.value, small.expectation[:10]) == ("size", "1280 x 100", "1280 x 720")
    free = lapservo.Rig(rig.camera, [lapservo.Instrument("PSM1", rig.instruments[0].marker)])
    assert "joints needs camera_from_rcm of PSM1" in refused(lapservo.calibrate_marker, [grey], free, joints={}).problem
    backwards = {"time_s": [1.0, 0.5], "a": [0, 0], "b": [0, 0], "c": [0, 0], "d": [0, 0]}
    assert refused(lapservo.calibrate_registration, [grey], free, joints=backwards).value == "0.5"
    assert "item" == refused(lapservo.calibrate_registration, [None], rig).field


def test_pictures_in_another_light_are_refused_as_on_the_command_line(recordings, swing):
    folder, chunk = recordings.folder / "linear", b"gAMA" + struct.pack(">I", 100000)
    folder.mkdir()
    for path in sorted((recordings.folder / "swing").glob("*.png"))[:12]:
        png = path.read_bytes()
        (folder / path.name).write_bytes(png[:33] + struct.pack(">I", 4) + chunk + struct.pack(">I", zlib.crc32(chunk)) +
                                         png[33:])
    camera = recordings.rig.camera
    rig = lapservo.Rig(lapservo.Camera(camera.width_px, camera.height_px, camera.matrix, response=1.7),
                       recordings.rig.instruments)
    for frame in pickle.loads(pickle.dumps(list(lapservo.open_frames(folder, fps=FPS)))):
        assert "is read as sRGB" in refused(lapservo.Tracker(rig).track, frame).problem
        assert lapservo.Tracker(recordings.rig).track(frame)
    with pytest.warns(UserWarning, match="names linear light: its light is read as sRGB"):
        refused(lapservo.calibrate_colour, frame.file, recordings.rig)
    for frames in (folder, lapservo.open_frames(folder, fps=FPS), list(lapservo.open_frames(folder, fps=FPS))):
        for calibrate in (lapservo.calibrate_colour, lapservo.calibrate_marker, lapservo.calibrate_registration):
            assert "is read as sRGB" in refused(calibrate, frames, rig, fps=FPS).problem


@pytest.mark.parametrize("times", [(0.0, float("nan")), (0.0, float("inf")), (0.0, 0.0), (1.0, 0.5)])
def test_times_that_are_none_or_do_not_rise_are_refused(rig, times):
    grey = np.full((rig.camera.height_px, rig.camera.width_px, 3), 90, np.uint8)
    frames = [(-1.0, grey)] + [(time, grey) for time in times]
    for calibrate in (lapservo.calibrate_colour, lapservo.calibrate_marker, lapservo.calibrate_registration):
        error = refused(calibrate, frames, rig)
        assert (error.source, error.field, error.value) == ("frames", "item 2", f"at {times[1]:g} s")
        assert error.expectation.startswith("a time after the ")
    assert refused(lapservo.calibrate_marker, [(float("nan"), grey)], rig).field == "item 0"


def test_pictures_of_a_board_have_no_order():
    grey = np.full((90, 160, 3), 90, np.uint8)
    assert "none of 2 images" in refused(lapservo.calibrate_camera, [(1.0, grey), (0.5, grey)], "9x6", 0.005).problem


def test_what_frames_raise_leaves_the_calibration(rig):
    def broken():
        yield np.full((rig.camera.height_px, rig.camera.width_px, 3), 90, np.uint8)
        raise ZeroDivisionError("the camera's driver")

    with pytest.raises(ZeroDivisionError, match="the camera's driver"):
        lapservo.calibrate_marker(broken(), rig)


@pytest.mark.parametrize("wrong", [3, None, [1, 2]])
def test_a_rig_of_a_wrong_type_is_a_type_error(rig, image, wrong):
    with pytest.raises(TypeError):
        lapservo.calibrate_colour([image], wrong)


class Table:
    """A table of columns, with the methods of a pandas DataFrame that are used."""

    def __init__(self, columns):
        self.pairs = columns

    @property
    def columns(self):
        return [name for name, _ in self.pairs]

    def keys(self):
        return self.columns

    def __getitem__(self, name):
        values = [values for other, values in self.pairs if other == name]
        return values[0] if len(values) == 1 else np.stack(values, axis=1)


TIMES = np.array([0, 0.5, 1])
JOINTS = {"time_s": TIMES, "a": [0, 0.1, 0.2], "b": (0, 0, 0), "c": np.zeros(3, int), "d": np.zeros(3, np.float32)}
STRUCTURED = np.zeros(3, [(name, float) for name in JOINTS])
STRUCTURED["time_s"] = TIMES
STAMPS = np.datetime64("2026-01-01T00:00:00", "ns") + (1e9 * TIMES).astype("timedelta64[ns]")


@pytest.mark.parametrize("joints", [JOINTS, Table(list(JOINTS.items())), STRUCTURED])
def test_joints_are_taken_from_any_table_of_columns(rig, joints):
    grey = np.full((rig.camera.height_px, rig.camera.width_px, 3), 90, np.uint8)
    free = lapservo.Rig(rig.camera, [lapservo.Instrument("PSM1", rig.instruments[0].marker)])
    assert "PSM1 is in none" in refused(lapservo.calibrate_registration, [grey], free, joints=joints).problem


@pytest.mark.parametrize(("joints", "field", "value"), [
    (3, "type", "int"),
    ([1, 2], "type", "list"),
    ([[0, 1, 2, 3, 4]], "type", "list"),
    (np.zeros((3, 5)), "type", "ndarray"),
    (JOINTS | {"time_s": STAMPS}, "time_s", "datetime64[ns]"),
    (JOINTS | {"time_s": STAMPS - STAMPS[0]}, "time_s", "timedelta64[ns]"),
    (JOINTS | {"time_s": STAMPS.astype("datetime64[ms]").tolist()}, "time_s", "datetime"),
    (JOINTS | {"a": ["0", "1", "2"]}, "a", "<U1"),
    (JOINTS | {"a": 0.5}, "a", "not one column"),
    (JOINTS | {"a": np.zeros((3, 1))}, "a", "not one column"),
    (Table([*JOINTS.items(), ("b", [1, 1, 1])]), "b", "not one column"),
])
def test_joints_that_are_no_columns_of_numbers_are_refused(rig, image, joints, field, value):
    error = refused(lapservo.calibrate_registration, [image], rig, joints=joints)
    assert (error.source, error.field) == ("joints", field) and error.value.startswith(value)
    if value.startswith(("datetime64", "timedelta64")):
        assert "seconds" in error.expectation


@pytest.mark.parametrize("time", [STAMPS[0], STAMPS[1] - STAMPS[0], STAMPS[0].astype("datetime64[ms]").item(), "now", None])
def test_times_of_another_type_are_refused(rig, image, time):
    path = lapservo.set_point([0, 0, 100, 100])
    for call in (
        lambda: lapservo.calibrate_colour([(time, image)], rig),
        lambda: lapservo.JointState(time, [0, 1.57, 0.06, 0]),
        lambda: path.at(time),
        *([] if time is None else [lambda: lapservo.Tracker(rig).track(image, time)]),
    ):
        error = refused(call)
        assert error.field == "type" and "number" in error.expectation

