"""The notebook's display is well-formed and has the object's values; a terminal's has a colour."""

import contextlib
import os
import pty
import re
import subprocess
import xml.etree.ElementTree as xml

import numpy as np
import pytest

import lapservo


def parsed(text):
    return xml.fromstring(f"<div>{text}</div>")


def test_an_observation_shows_its_numbers_and_on_request_its_frame(rig, image):
    seen = lapservo.Tracker(rig).track(image, 1.5)[0]
    page = parsed(seen._repr_html_())
    assert page.find("table/caption").text == "PSM1: ok, 1.500 s"
    rows = {row[0].text: row for row in page.iter("tr")}
    assert float(rows["psi [rad]"][1].text) == pytest.approx(seen.q[3], rel=1e-5)
    assert float(rows["psi [rad]"][2].text) == pytest.approx(np.sqrt(seen.q_covariance[3, 3]), rel=1e-5)
    shown = seen.show(image)
    assert np.array_equal(shown.image, seen.overlay(image)) and shown._repr_png_().startswith(b"\x89PNG")
    nothing = lapservo.Tracker(rig).track(np.full_like(image, 90))[0]
    assert parsed(nothing._repr_html_()).find("table/caption").text == "PSM1: no_marker"


def test_a_picture_is_lossless(image, tmp_path):
    (tmp_path / "a.png").write_bytes(lapservo.Picture(image)._repr_png_())
    assert np.array_equal(lapservo.read_image(tmp_path / "a.png"), image)
    assert next(iter(lapservo.open_frames(tmp_path / "a.png")))._repr_png_().startswith(b"\x89PNG")
    with pytest.raises(lapservo.InputError):
        lapservo.Picture(image[0])


def test_a_rig_and_its_marker_show(rig):
    cells = [cell.text for cell in parsed(rig._repr_html_()).iter("td")]
    assert cells[0] == "PSM1" and f"{1e3 * rig.instruments[0].marker.diameter_m:.3f}" in cells and "yes" in cells
    odd = lapservo.Rig(rig.camera, [lapservo.Instrument("a<b&c", rig.instruments[0].marker)])
    assert parsed(odd._repr_html_()).find(".//td").text == "a<b&c"
    assert xml.fromstring(rig.instruments[0].marker._repr_svg_()).tag.endswith("svg")


def test_a_verdict_has_a_colour_on_a_terminal(sample):
    command = [os.environ["LAPSERVO_TOOL"], "check", sample / "video.mp4", "--joints", sample / "swing_joints.csv", "--rig",
               sample / "truth.yaml"]
    ours, theirs = pty.openpty()
    check = subprocess.Popen(command, stdout=theirs, stderr=subprocess.DEVNULL)
    os.close(theirs)
    said = ""
    with contextlib.suppress(OSError):  # the terminal has no other end any more
        while True:
            said += os.read(ours, 4096).decode()
    good = check.wait() == 0
    assert re.search("\033\\[32mgood enough\033" if good else "\033\\[31mnot good enough.*\033", said), said
