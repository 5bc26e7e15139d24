"""Measures the values of a rig: the command line's `calibrate`, with arrays in and values out."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields
from typing import Any, Callable, Optional, Union

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _lapservo as _core  # type: ignore[attr-defined]
from ._errors import InputError

_Array = NDArray[np.float64]
_Image = NDArray[np.uint8]
_Path = Union[str, "os.PathLike[str]"]
#: A path (an image, a folder, a video, a camera), a FrameSource, or what gives, one after another, uint8[H, W, 3],
#: (time_s, uint8[H, W, 3]) or Frame.
Frames = Union[_Path, Any, Iterable[Any]]
#: Done, of how many where that is known, a remark.
Progress = Callable[[int, Optional[int], str], object]


@dataclass(frozen=True)
class CalibratedNumber:
    """A number that was measured, in the unit that its name ends in; sigma: one standard deviation.

    `before` is NaN where the rig had none.
    """

    name: str
    before: float
    after: float
    sigma: float


@dataclass(frozen=True, eq=False)
class Calibration:
    """The fields of every calibration.

    `rig` is the Rig with what was measured; `yaml` the same as the command line writes it. `faults`: of the recording,
    that show beyond the noise and count in the sigmas, a sentence each.
    """

    rig: Any = field(repr=False)
    yaml: str = field(repr=False)
    numbers: list[CalibratedNumber] = field(repr=False)
    complaint: str = field(repr=False)
    faults: list[str] = field(repr=False)

    def save(self, path: _Path) -> None:
        """Writes `yaml`, whole or not at all; a camera's own file is named so that it is found from there.

        Raises InputError where a rig would replace the file of a camera or a tool.
        """
        _core._write_calibrated(self.rig, self.yaml, path)


@dataclass(frozen=True, eq=False)
class CameraCalibration(Calibration):
    """Matrix, distortion, lateral chromatic aberration and response, from images of a board.

    rms_px: what edges miss the fit by, noise: how many times their own noise that is. views: name, corners, rms [px] of
    each image that was used. advice: what more images should show, or ''. sigma_response: of encoded values (0 to 1),
    None where the images don't determine the response. sharpening: its strength, 0 for none.
    """

    camera: Any
    rms_px: float
    noise: float
    views: list[tuple[str, int, float]] = field(repr=False)
    without_board: list[str] = field(repr=False)
    advice: str
    sigma_response: Optional[float]
    sharpening: float


@dataclass(frozen=True, eq=False)
class ColourCalibration(Calibration):
    """The hues of a mounted marker's bands as the camera has them [deg], and in words how it encodes light.

    Of `frames` frames the marker was found in `found_before` with the rig's hues and in `found` with these.
    """

    instrument: str
    hues_deg: list[float]
    sigma_hues_deg: list[float]
    response: str
    found_before: int
    found: int
    frames: int


@dataclass(frozen=True, eq=False)
class MarkerCalibration(Calibration):
    """A print as it is: the rig's instrument has the Marker, with `sigmas`.

    Of `looked_at` frames the marker was found in `found`; `frames` of them, from all sides, are used, `seam_views` of
    these show the seam. Boundaries miss the rig's print by before_px rms and the calibrated one by after_px.
    seam_may_lag: the frames look like a compressed video's and turn one way only: psi may be some mrad off, which a turn
    there and back would show it.
    """

    instrument: str
    looked_at: int
    found: int
    frames: int
    seam_views: int
    before_px: float
    after_px: float
    seam_may_lag: bool

    @property
    def marker(self) -> Any:
        """The Marker as it was measured."""
        return _named(self.rig, self.instrument).marker


@dataclass(frozen=True, eq=False)
class RegistrationCalibration(Calibration):
    """Where an arm stands before its camera.

    camera_from_rcm: float[4, 4], metres; sigma_translation_m: float[3]; sigma_quaternion_xyzw: float[4], None where the
    rotation is a convention or the rig's, as sigma_rotation_rad. With joints: sigma_offset and backlash float[4] (rad,
    rad, m, rad), image_delay_s and its sigma; None without. residuals: float[N, 4], a row a frame: time [s], place [m],
    axis [rad], roll [rad]; without joints the place is how far the axis misses the RCM. unknown: what these data don't
    determine, a sentence each.
    """

    instrument: str
    camera_from_rcm: _Array
    sigma_translation_m: _Array
    sigma_quaternion_xyzw: Optional[_Array]
    sigma_rotation_rad: Optional[float]
    sigma_offset: Optional[list[float]]
    image_delay_s: Optional[float]
    sigma_image_delay_s: Optional[float]
    backlash: Optional[list[float]] = field(repr=False)
    residuals: _Array = field(repr=False)
    unknown: list[str] = field(repr=False)

    @property
    def joints(self) -> Any:
        """The Joints as they were measured; None where neither joints nor rig have them."""
        return _named(self.rig, self.instrument).joints


def _named(rig: Any, name: str) -> Any:
    return next(instrument for instrument in rig.instruments if instrument.name == name)


def _result(kind: type, measured: dict[str, Any]) -> Any:
    measured["numbers"] = [CalibratedNumber(*row) for row in measured["numbers"]]
    return kind(**{each.name: measured[each.name] for each in fields(kind)})


def calibrate_camera(
    pictures: Union[Frames, Sequence[_Path]],
    board: str,
    square_m: float,
    *,
    rig: Union[Any, _Path, None] = None,
    dictionary: str = "",
    marker_m: Optional[float] = None,
    views: int = 30,
    progress: Optional[Progress] = None,
) -> CameraCalibration:
    """Measures a camera with a chessboard, or a ChArUco board of a `dictionary` as DICT_4X4_50.

    `pictures`: a path or several, or uint8[H, W, 3] one after another; board: inner corners, '9x6'; square_m: a square's
    width; marker_m: a ChArUco marker's width, else 3/4 of a square; views: at most, of a video. rig: a Rig or its path,
    whose response is where the search starts; without it the result's rig is None and yaml the camera's own.

    Raises InputError for what can't be used, and with `problem` where the images don't suffice.
    """
    several = isinstance(pictures, (list, tuple)) and all(isinstance(each, (str, os.PathLike)) for each in pictures)
    inputs = list(pictures) if several else [pictures]  # type: ignore[arg-type]
    return _result(
        CameraCalibration,
        _core._calibrate_camera(inputs, board, square_m, rig, dictionary, marker_m, views, progress),
    )


def calibrate_colour(
    frames: Frames,
    rig: Union[Any, _Path],
    *,
    instrument: Optional[str] = None,
    replace_response: bool = False,
    deinterlace: bool = False,
    fps: float = 30.0,
    progress: Optional[Progress] = None,
) -> ColourCalibration:
    """Measures the hues of a mounted marker's bands, and how the camera encodes light, from frames of it in motion.

    rig: a Rig or its path, its hues up to 60 degrees off; instrument: its name, where the rig has several;
    replace_response: also a response that calibrate_camera measured; fps: of a folder or of arrays.

    Raises InputError for what can't be used, and with `problem` where the frames don't suffice.
    """
    return _result(
        ColourCalibration,
        _core._calibrate_colour(frames, rig, instrument, replace_response, deinterlace, fps, progress),
    )


def calibrate_marker(
    frames: Frames,
    rig: Union[Any, _Path],
    *,
    joints: Union[_Path, Mapping[str, ArrayLike], Any, None] = None,
    instrument: Optional[str] = None,
    deinterlace: bool = False,
    fps: float = 30.0,
    progress: Optional[Progress] = None,
) -> MarkerCalibration:
    """Measures a mounted marker's print from frames of a slow full turn: bands, wrap, skew, gap.

    rig: a Rig or its path; joints: a CSV's path, or arrays by name (a dict, a DataFrame), time_s [s] and those of the rig's joints [rad, rad,
    m, rad]: the seam too, which takes the rig's camera_from_rcm and joints; instrument: its name, where the rig has
    several; fps: of a folder or of arrays.

    Raises InputError for what can't be used, and with `problem` where the frames don't suffice.
    """
    return _result(
        MarkerCalibration,
        _core._calibrate_marker(frames, rig, _columns(joints), instrument, deinterlace, fps, progress),
    )


def calibrate_registration(
    frames: Frames,
    rig: Union[Any, _Path],
    *,
    joints: Union[_Path, Mapping[str, ArrayLike], Any, None] = None,
    instrument: Optional[str] = None,
    deinterlace: bool = False,
    fps: float = 30.0,
    progress: Optional[Progress] = None,
) -> RegistrationCalibration:
    """Measures where the arm stands before the camera, its joints' signs and offsets, and the video's delay.

    frames: of the marker in motion, or a CSV of observations that were tracked without camera_from_rcm; joints: a CSV's
    path, or arrays by name (a dict, a DataFrame), time_s [s] and four joints [rad, rad, m, rad], by a clock up to 30 s off; without any only
    the RCM's place is measured. rig: a Rig or its path; fps: of a folder or of arrays.

    Raises InputError for what can't be used, and with `problem` where the frames don't suffice.
    """
    return _result(
        RegistrationCalibration,
        _core._calibrate_registration(frames, rig, _columns(joints), instrument, deinterlace, fps, progress),
    )


def _columns(joints: Any) -> Any:
    """A path as it is; else lists of numbers by name, of a mapping or a table (pandas, a structured array)."""
    if joints is None or isinstance(joints, (str, os.PathLike)):
        return joints
    names = joints.keys() if hasattr(joints, "keys") else getattr(joints, "columns", None)
    if names is None:
        names = getattr(getattr(joints, "dtype", None), "names", None)
    if names is None:
        raise _refused("joints", "type", type(joints).__name__, "a CSV's path, or numbers by name: time_s and the joints")
    columns: dict[str, list[float]] = {}
    for name in names:
        if str(name) in columns or np.ndim(joints[name]) != 1:
            raise _refused("joints", str(name), "not one column", "one column of numbers of this name")
        columns[str(name)] = _numbers(joints[name], str(name))
    return columns


def _numbers(values: Any, name: str) -> list[float]:
    array = np.asarray(values)
    try:
        if array.dtype.kind in "fiubO":
            return np.asarray(array, float).tolist()  # type: ignore[no-any-return]
    except (TypeError, ValueError):
        pass
    kind = type(array.flat[0]).__name__ if array.dtype.kind == "O" else str(array.dtype)
    raise _refused("joints", name, kind, "numbers; times in seconds: (t - t[0]) / numpy.timedelta64(1, 's')")


def _refused(source: str, name: str, value: str, expectation: str) -> InputError:
    return InputError(f"{source}: {name}: is {value}, expected {expectation}", source, name, value, expectation)
