"""How a notebook shows what the module makes."""

from __future__ import annotations

import html
import math
import pathlib
import tempfile
from typing import Any, Optional

import numpy as np
from numpy.typing import NDArray

from . import _calibration
from . import _lapservo as _core  # type: ignore[attr-defined]


class Picture:
    """An image that a notebook shows; `image` is uint8[H, W, 3], blue green red."""

    def __init__(self, image: NDArray[np.uint8]) -> None:
        self.image = _core._picture(image)  # what can't be shown is refused here

    def _repr_png_(self) -> bytes:
        return _core._png(self.image)  # type: ignore[no-any-return]

    def __repr__(self) -> str:
        return f"<lapservo.Picture {self.image.shape[1]} x {self.image.shape[0]}>"


def _table(caption: str, header: list[str], rows: list[list[str]], notes: list[str]) -> str:
    def line(cells: list[str], tag: str) -> str:
        return "<tr>" + "".join(f"<{tag}>{html.escape(cell)}</{tag}>" for cell in cells) + "</tr>"

    return (f"<table><caption>{html.escape(caption)}</caption><thead>{line(header, 'th')}</thead><tbody>"
            + "".join(line(row, "td") for row in rows) + "</tbody></table>"
            + "".join(f"<p>{html.escape(note)}</p>" for note in notes if note))


def _number(value: Optional[float]) -> str:
    return f"{value:.6g}" if value is not None and math.isfinite(value) else ""


def _observation(seen: Any) -> str:
    """The numbers; the overlay takes the frame, which an observation doesn't keep: show(image)."""
    rows: list[Any] = []
    sigma = seen.sigma
    if seen.q is not None:
        rows += zip(("theta [rad]", "phi [rad]", "rho [m]", "psi [rad]"), seen.q, sigma[:4])
    if seen.features is not None:
        rows += zip(("s [rad]", "r [px]", "l [px]", "d [px]"), seen.features, sigma[5:])
        rows.append(("tau [rad]", seen.tau_rad, sigma.tau))
    stamp = "" if seen.stamp_s is None else f", {seen.stamp_s:.3f} s"
    caption = f"{seen.instrument}: {seen.status.value}{stamp}"
    return _table(caption, ["", "value", "sigma"], [[n, _number(v), _number(s)] for n, v, s in rows], [])


def _rig(rig: Any) -> str:
    camera = rig.camera
    rows = []
    for each in rig.instruments:
        marker = each.marker
        rows.append([each.name, f"{1e3 * marker.diameter_m:.3f}", f"{1e3 * marker.length_m:.3f}",
                     ", ".join(f"{hue:.0f}" for hue in marker.hues_deg),
                     "no" if each.camera_from_rcm is None else "yes", ", ".join(each.joints.names) if each.joints else "no",
                     "no" if each.image_delay_s is None else f"{1e3 * each.image_delay_s:.1f}"])
    matrix = camera.matrix
    caption = (f"{camera.width_px} x {camera.height_px} px, focal length {matrix[0, 0]:.1f}, {matrix[1, 1]:.1f} px, "
               f"centre {matrix[0, 2]:.1f}, {matrix[1, 2]:.1f} px")
    header = ["instrument", "diameter [mm]", "length [mm]", "hues [deg]", "camera_from_rcm", "joints", "delay [ms]"]
    return _table(caption, header, rows, [])


def _marker(marker: Any) -> str:
    """Unrolled, with its cross-ratio and predicted sigma over tau."""
    with tempfile.TemporaryDirectory() as folder:
        path = pathlib.Path(folder) / "marker.svg"
        _core._marker_picture(path, marker)
        return path.read_text()


def _calibration_table(result: _calibration.Calibration) -> str:
    rows = [[n.name, _number(n.before), _number(n.after), _number(n.sigma)] for n in result.numbers]
    notes = [result.complaint, *result.faults]
    if isinstance(result, _calibration.CameraCalibration):
        caption = f"Camera: edges of {len(result.views)} views miss the fit by {result.rms_px:.3f} px rms"
        notes.append(f"Better still: {result.advice}" if result.advice else "")
    elif isinstance(result, _calibration.ColourCalibration):
        caption = (f"{result.instrument}: found in {result.found_before} of {result.frames} frames before, in "
                   f"{result.found} after")
        notes.append(f"Response: {result.response}")
    elif isinstance(result, _calibration.MarkerCalibration):
        caption = (f"{result.instrument}: boundaries miss the print by {result.before_px:.3f} px rms before, "
                   f"{result.after_px:.3f} px after, in {result.frames} frames")
    elif isinstance(result, _calibration.RegistrationCalibration):
        caption = f"{result.instrument}: where the arm stands, from {len(result.residuals)} frames"
        notes += result.unknown
    else:
        caption = ""
    return _table(caption, ["", "before", "after", "sigma"], rows, notes)


def _show(self: Any, image: NDArray[np.uint8]) -> Picture:
    """The overlay as a notebook shows it: a `Picture`, with the new uint8[H, W, 3] in `image`."""
    return Picture(self.overlay(image))


_core.Observation._repr_html_ = _observation
_core.Observation.show = _show
_core.Frame._repr_png_ = lambda frame: _core._png(frame.image)
_core.Rig._repr_html_ = _rig
_core.Marker._repr_svg_ = _marker
_calibration.Calibration._repr_html_ = _calibration_table  # type: ignore[attr-defined]
