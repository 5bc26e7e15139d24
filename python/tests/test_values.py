"""Values: pickled, copied, compared, written as tables and shown by help()."""

import copy
import csv
import os
import pathlib
import pickle
import pydoc
import re
import shutil
import subprocess
import sys

import numpy as np
import pytest
from conftest import Q, SOURCE
from test_lapservo import free

import lapservo


@pytest.fixture(scope="module")
def values(rig, image, tmp_path_factory):
    path = tmp_path_factory.mktemp("values") / "a.png"
    path.write_bytes(lapservo.Picture(image)._repr_png_())
    instrument, frame = rig.instruments[0], next(iter(lapservo.open_frames(path)))
    seen = [lapservo.Tracker(rig).track(image)[0], lapservo.Tracker(free(rig)).track(image, 1.0)[0],
            lapservo.Tracker(rig).track(np.full_like(image, 90))[0]]
    measured = re.sub("^( +)(diameter_m:)", r"\1sigma_diameter_m: 0.00001\n\1\2", rig.to_yaml(), flags=re.MULTILINE)
    camera = lapservo.Camera(64, 48, np.diag([50, 60, 1.0]), distortion=[0.1, 0, 0, 0], response=([0, 0.2, 1], [0, 0.5, 1]),
                             chromatic_aberration=(1.001, 0.999), deinterlace=True, readout_s=0.01, sigma_response=0.01)
    return [rig, lapservo.Rig.load(SOURCE / "configs" / "paper.yaml"), lapservo.Rig.parse(measured), rig.camera, camera,
            instrument, lapservo.Instrument("x", instrument.marker), instrument.marker, instrument.joints,
            lapservo.Joints(list("abcd"), sign=[1, -1, 1, 1]), frame, seen[0].marker_pose, *seen]


def test_copies_and_pickles_equal(values):
    for value in values:
        for again in (copy.copy(value), copy.deepcopy(value), pickle.loads(pickle.dumps(value))):
            assert again is not value and again == value and hash(again) == hash(value), repr(value)
            assert repr(again) == repr(value) and type(again) is type(value) and "0x" not in repr(value)
        assert value != "something else" and not value == None  # noqa: E711
    for value in {type(value): value for value in values}.values():
        assert all(other != value for other in values if other is not value and repr(other) != repr(value))


def test_what_differs_is_not_equal(rig, image, tmp_path):
    marker, camera = rig.instruments[0].marker, rig.camera
    names = ("diameter_m", "bands_upper_m", "bands_lower_m", "hues_deg", "seam_rad", "tolerance_m", "wrap_m", "skew_m",
             "gap_rad")
    numbers = {name: getattr(marker, name) for name in names}
    assert lapservo.Marker(**numbers) == marker
    assert lapservo.Marker(**numbers | {"seam_rad": 0.001}) != marker
    assert lapservo.Camera(camera.width_px, camera.height_px, camera.matrix + [[1e-9, 0, 0], [0, 0, 0], [0, 0, 0]]) != camera
    other = image.copy()
    other[0, 0, 0] ^= 1
    frames = []
    for i, picture in enumerate((image, other)):
        folder = tmp_path / str(i)
        folder.mkdir()
        (folder / "a.png").write_bytes(lapservo.Picture(picture)._repr_png_())
        shutil.copy(folder / "a.png", tmp_path / "a.png")
        frames.append(next(iter(lapservo.open_frames(tmp_path / "a.png"))))
    assert frames[0] != frames[1] and repr(frames[0]) == repr(frames[1])


def test_what_attributes_give_is_not_changed_in_vain(values, rig):
    measured, simulator = values[2].instruments[0].marker, lapservo.Simulator(rig, Q)
    for thing in [*values, measured, simulator, simulator.state()]:
        for name in dir(thing):
            given = None if name.startswith("_") or name == "image" else getattr(thing, name)
            assert not isinstance(given, (list, dict)), name
            assert not isinstance(given, np.ndarray) or not given.flags.writeable, name
    with pytest.raises(ValueError, match="read-only"):
        rig.instruments[0].camera_from_rcm[0, 3] += 0.01
    assert hash(values[4].response), "tuples of tuples"
    with pytest.raises(TypeError, match="item assignment"):
        measured.sigmas["diameter_m"] = 0
    with pytest.raises(AttributeError, match="append"):
        rig.instruments.append(rig.instruments[0])


def test_a_pickled_observation_is_whole(rig, image):
    for seen in (lapservo.Tracker(rig).track(image)[0], lapservo.Tracker(free(rig)).track(image, 1.0)[0]):
        again = pickle.loads(pickle.dumps(seen))
        assert again.stamp_s == seen.stamp_s and again.sigma == seen.sigma and again.to_dict() == seen.to_dict()
        assert np.array_equal(again.edges_covariance_px2, seen.edges_covariance_px2)
        assert np.array_equal(again.overlay(image), seen.overlay(image))


def test_sigmas_are_roots_of_covariances(rig, image):
    seen = lapservo.Tracker(rig).track(image)[0]
    assert seen.sigma.psi == np.sqrt(seen.q_covariance[3, 3]) and seen.sigma.tau == seen.sigma_tau_rad
    assert seen.sigma[:4] == tuple(np.sqrt(np.diag(seen.q_covariance)))
    assert (seen.sigma.s, seen.sigma.r, seen.sigma.l, seen.sigma.d) == tuple(np.sqrt(np.diag(seen.features_covariance)))
    without = lapservo.Tracker(free(rig)).track(image)[0].sigma
    assert without.psi is None and without.r is None and without.l > 0
    assert set(lapservo.Tracker(rig).track(np.full_like(image, 90))[0].sigma) == {None}


def test_sigma_of_r_has_what_the_rig_says_of_the_rcm(rig, image):
    sigmas, text = [0.001, 0.002, 0.003], rig.to_yaml()
    text = re.sub("^( +)(translation_m:)", rf"\1sigma_translation_m: {sigmas}\n\1\2", text, flags=re.MULTILINE)
    (x, y, z), (fx, fy) = rig.instruments[0].camera_from_rcm[:3, 3], np.diag(rig.camera.matrix)[:2]
    seen = lapservo.Tracker(lapservo.Rig.parse(text)).track(image)[0]
    along_px = seen.edges_ideal_px[0] - [fx * x / z, fy * y / z] - rig.camera.matrix[:2, 2]
    moved_px = along_px / np.linalg.norm(along_px) @ np.array([[fx, 0, -fx * x / z], [0, fy, -fy * y / z]]) / z * sigmas
    assert seen.sigma.r == pytest.approx(np.linalg.norm(moved_px), rel=1e-3)


@pytest.mark.parametrize("folder", sorted(p.parent for p in (SOURCE / "acceptance" / "frames").glob("*/rig.yaml")),
                         ids=lambda folder: folder.name)
def test_a_table_is_the_command_lines(folder, tmp_path):
    out = tmp_path / "obs.csv"
    subprocess.run([os.environ["LAPSERVO_TOOL"], "track", folder, "--rig", folder / "rig.yaml", "--out", out], check=True,
                   capture_output=True)
    tracker, seen = lapservo.Tracker(lapservo.Rig.load(folder / "rig.yaml"), frame_budget=None), []
    with lapservo.ObservationCsv(tmp_path / "ours.csv") as table:
        for frame in lapservo.open_frames(folder):
            observations = tracker.track(frame)
            table.add(observations, frame)
            seen += observations
    assert (tmp_path / "ours.csv").read_bytes() == out.read_bytes()
    with open(out) as file:
        rows = list(csv.DictReader(file))
    assert len(seen) == len(rows) and any(each.ok for each in seen)
    for ours, row in zip(seen, rows):
        numbers = ours.to_dict()
        assert numbers.pop("status") == row["status"] and numbers.pop("instrument") == row["instrument"]
        assert numbers.pop("stamp_s") == pytest.approx(float(row["time_s"]), abs=1e-6)
        assert [*numbers] == [*row][5:]
        for name, value in numbers.items():
            assert row[name] == "" if value is None else value == pytest.approx(float(row[name]), rel=1e-3, abs=1e-4)
        if ours.ok:
            assert ours.edges_px.ravel().tolist() == [numbers[f"e{i}_{k}_px"] for i in range(4) for k in "uv"]
            assert [ours.tau_rad, *ours.features[[0, 2]]] == [numbers[name] for name in ("tau_rad", "s_rad", "l_px")]
            q = [numbers[name] for name in ("theta_rad", "phi_rad", "rho_m", "psi_rad")]
            assert q == (4 * [None] if ours.q is None else ours.q.tolist())


def test_a_table_of_arrays_takes_stamps_and_keeps_its_rows_whatever_ends_it(rig, image, tmp_path):
    seen = lapservo.Tracker(rig).track(image, 0.25)
    with lapservo.ObservationCsv(tmp_path / "a.csv") as table:
        table.add(seen)
        table.add(seen)
    with pytest.raises(lapservo.InputError, match="after the end"):
        table.add(seen)
    rows = (tmp_path / "a.csv").read_text().splitlines()
    assert rows[1].startswith("0,0.250000,,PSM1,ok,") and rows[2].startswith("1,0.250000,,PSM1,ok,") and len(rows) == 3
    with pytest.raises(lapservo.InputError, match="stamp_s"), lapservo.ObservationCsv(tmp_path / "b.csv") as table:
        table.add(lapservo.Tracker(rig).track(image))
    with pytest.raises(KeyboardInterrupt), lapservo.ObservationCsv(tmp_path / "a.csv") as table:
        table.add(seen)
        raise KeyboardInterrupt
    lapservo.ObservationCsv(tmp_path / "c.csv").add(seen)
    assert (tmp_path / "a.csv").read_text().splitlines() == rows
    assert {path.name for path in tmp_path.iterdir()} == {"a.csv", "a.csv.part", "c.csv.part"}
    for name in ("a", "c"):
        assert (tmp_path / f"{name}.csv.part").read_text().splitlines() == rows[:2]


def test_each_status_says_what_it_means():
    from lapservo import _lapservo

    assert [status.value for status in lapservo.Status] == _lapservo._statuses
    for status in lapservo.Status:
        assert len(status.__doc__) > 10 and f"{status.value}: {status.__doc__}" in pydoc.render_doc(lapservo.Status)
        assert pickle.loads(pickle.dumps(status)) is status and lapservo.Status(status.value) is status


def test_help_names_the_package():
    for name in lapservo.__all__:
        thing = getattr(lapservo, name)
        assert thing.__module__ == "lapservo"
        assert "_lapservo." not in pydoc.render_doc(thing, renderer=pydoc.plaintext), name
    assert "rig: lapservo.Rig" in lapservo.Tracker.__init__.__doc__


def test_types_carry_docstrings_and_defaults():
    text = (pathlib.Path(lapservo.__file__).parent / "__init__.pyi").read_text()
    assert "..." not in [line.partition("=")[2].strip(" ,)") for line in text.splitlines()]
    for part in ("Finds all instruments of a rig", "stamp_s: Optional[float]=None", "hues_deg: ArrayLike=[90.0, 180.0, 270.0]",
                 "phase_rad: ArrayLike=[0.0, 0.0, 0.0, 0.0]", "Reads a rig's YAML file.", "mode: str='fused'",
                 "one per instrument, of uint8[H, W, 3]", "The same of a Frame", "Section V-D's."):
        assert part in text, part
    assert text.count('"""') > 150


def test_another_python_is_told_debians(tmp_path):
    for path in pathlib.Path(lapservo.__file__).parent.glob("*.py"):
        (tmp_path / "lapservo").mkdir(exist_ok=True)
        shutil.copy(path, tmp_path / "lapservo")
    ran = subprocess.run([sys.executable, "-c", "import lapservo"], cwd=tmp_path, env={"PATH": "/usr/bin"}, text=True,
                         capture_output=True)
    assert ran.returncode == 1 and "built for Debian's Python, run /usr/bin/python3" in ran.stderr.splitlines()[-1]
