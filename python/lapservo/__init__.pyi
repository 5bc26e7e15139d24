import os
from collections.abc import Callable, Mapping, Sequence
from types import TracebackType
from typing import Optional, Union, final, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._calibration import (
    CalibratedNumber as CalibratedNumber,
    Calibration as Calibration,
    CameraCalibration as CameraCalibration,
    ColourCalibration as ColourCalibration,
    MarkerCalibration as MarkerCalibration,
    RegistrationCalibration as RegistrationCalibration,
    calibrate_camera as calibrate_camera,
    calibrate_colour as calibrate_colour,
    calibrate_marker as calibrate_marker,
    calibrate_registration as calibrate_registration,
)
from ._display import Picture as Picture
from ._errors import InputError as InputError
from ._observation import Sigmas as Sigmas
from ._status import Status as Status

_Array = NDArray[np.float64]
_Image = NDArray[np.uint8]
_Path = Union[str, os.PathLike[str]]

__version__: str

class Camera:
    def __init__(
        self,
        width_px: int,
        height_px: int,
        matrix: ArrayLike,
        *,
        distortion: ArrayLike = ...,
        response: Union[str, float, tuple[Sequence[float], Sequence[float]]] = ...,
        chromatic_aberration: tuple[float, float] = ...,
        deinterlace: bool = ...,
        readout_s: float = ...,
        sigma_response: Optional[float] = ...,
    ) -> None: ...
    width_px: int
    height_px: int
    matrix: _Array
    distortion: tuple[float, ...]
    response: Union[str, float, tuple[tuple[float, ...], tuple[float, ...]]]
    chromatic_aberration: tuple[float, float]
    deinterlace: bool
    readout_s: float
    sigma_response: Optional[float]
    def ideal_from_raw(self, raw_px: ArrayLike) -> Optional[_Array]: ...
    def raw_from_ideal(self, ideal_px: ArrayLike) -> _Array: ...

class Marker:
    def __init__(
        self,
        *,
        diameter_m: float,
        bands_upper_m: ArrayLike,
        bands_lower_m: ArrayLike,
        hues_deg: ArrayLike = ...,
        seam_rad: float = ...,
        tolerance_m: float = ...,
        wrap_m: float = ...,
        skew_m: float = ...,
        gap_rad: float = ...,
    ) -> None: ...
    diameter_m: float
    hues_deg: tuple[float, ...]
    bands_upper_m: tuple[float, ...]
    bands_lower_m: tuple[float, ...]
    seam_rad: float
    tolerance_m: float
    wrap_m: float
    skew_m: float
    gap_rad: float
    sigmas: Mapping[str, Union[float, tuple[float, ...]]]
    length_m: float
    def boundaries_m(self, tau_rad: float) -> list[float]: ...
    def cross_ratio(self, tau_rad: float) -> float: ...
    def decode(self, cross_ratio: float) -> float: ...
    def predicted_sigma_rad(
        self, tau_rad: float, focal_px: float = ..., distance_m: float = ..., sigma_edge_px: float = ...
    ) -> float: ...

class Joints:
    def __init__(self, names: Sequence[str], *, sign: ArrayLike = ..., offset: ArrayLike = ...) -> None: ...
    names: tuple[str, ...]
    sign: tuple[float, ...]
    offset: tuple[float, ...]

class Instrument:
    def __init__(
        self,
        name: str,
        marker: Marker,
        *,
        camera_from_rcm: Optional[ArrayLike] = ...,
        joints: Optional[Joints] = ...,
        image_delay_s: Optional[float] = ...,
    ) -> None: ...
    joints: Optional[Joints]
    name: str
    marker: Marker
    camera_from_rcm: Optional[_Array]
    image_delay_s: Optional[float]
    wrist_joints: tuple[str, ...]

class Rig:
    def __init__(self, camera: Camera, instruments: Sequence[Instrument]) -> None: ...
    @staticmethod
    def load(path: _Path) -> Rig: ...
    @staticmethod
    def parse(yaml: str, folder: _Path = ...) -> Rig: ...
    camera: Camera
    instruments: tuple[Instrument, ...]
    def save(self, path: _Path) -> None: ...
    def to_yaml(self) -> str: ...

class MarkerPose:
    camera_from_marker: _Array
    sigma_xy_m: float
    sigma_z_m: float
    sigma_axis_rad: float
    sigma_roll_rad: float
    covariance: _Array

class WristJoint:
    name: str

class TipPose:
    camera_from_tip: _Array
    covariance: _Array
    sigma_m: float
    sigma_shaft_m: float
    sigma_place_m: float
    sigma_readings_m: float

class Observation:
    status: Status
    ok: bool
    instrument: str
    stamp_s: Optional[float]
    q: Optional[_Array]
    q_covariance: Optional[_Array]
    features: Optional[_Array]
    features_covariance: Optional[_Array]
    cross_ratio: Optional[float]
    tau_rad: Optional[float]
    sigma_tau_rad: Optional[float]
    p_false: Optional[float]
    edges_px: Optional[_Array]
    edges_ideal_px: Optional[_Array]
    edges_covariance_px2: Optional[_Array]
    marker_pose: Optional[MarkerPose]
    tip: Optional[TipPose]
    sigma: Sigmas
    def to_dict(self) -> dict[str, Union[str, float, None]]: ...
    def overlay(self, image: _Image) -> _Image: ...
    def show(self, image: _Image) -> Picture: ...

class ObservationCsv:
    def __init__(self, path: _Path) -> None: ...
    def add(self, observations: Sequence[Observation], frame: Optional[Frame] = ...) -> None: ...
    def __enter__(self) -> ObservationCsv: ...
    def __exit__(
        self, kind: Optional[type[BaseException]], error: Optional[BaseException], trace: Optional[TracebackType]
    ) -> None: ...

class Frame:
    image: _Image
    index: int
    time_s: float
    file: os.PathLike[str]
    flaw: Optional[Status]

class FrameSource:
    frame_count: Optional[int]
    frames_per_second: float
    remark: str
    complaint: str
    def __iter__(self) -> FrameSource: ...
    def __next__(self) -> Frame: ...

class Tracker:
    def __init__(
        self,
        rig: Rig,
        *,
        method: str = ...,
        single: bool = ...,
        deinterlace: bool = ...,
        frame_budget: Optional[float] = ...,
        max_p_false: float = ...,
    ) -> None: ...
    @overload
    def track(self, image: _Image, stamp_s: Optional[float] = ...) -> list[Observation]: ...
    @overload
    def track(self, frame: Frame) -> list[Observation]: ...
    def set_wrist(self, instrument: str, wrist_rad: Sequence[float]) -> None: ...
    def reset(self) -> None: ...

class Kinematics:
    def __init__(self, rig: Rig) -> None: ...
    def features(self, q: ArrayLike) -> Optional[_Array]: ...
    def jacobian(self, q: ArrayLike) -> Optional[_Array]: ...
    def inverse(self, features: ArrayLike, guess: ArrayLike) -> Optional[_Array]: ...

class RcmEstimate:
    status: str
    point_px: Optional[_Array]
    covariance_px2: Optional[_Array]
    lines: int
    outliers: int
    near_parallel: bool
    faults: tuple[str, ...]

class JointState:
    def __init__(self, time_s: float, q: ArrayLike, operating_state: str = ..., follows: bool = ...,
                 started: bool = ..., blocked: str = ..., wrist_rad: Sequence[float] = ...) -> None: ...
    time_s: float
    q: _Array
    operating_state: str
    follows: bool
    started: bool
    blocked: str
    wrist_rad: tuple[float, ...]

class JointPath:
    def copy(self) -> JointPath: ...
    def at(self, time_s: float) -> tuple[_Array, _Array]: ...

class Robot:
    def __init__(self) -> None: ...
    def state(self) -> JointState: ...
    def readings(self) -> list[tuple[float, _Array]]: ...
    def send(self, path: JointPath) -> None: ...
    def release(self) -> None: ...
    def is_simulated(self) -> bool: ...

class ImageStream:
    def __init__(self) -> None: ...
    def newest(self) -> Optional[tuple[float, _Image]]: ...
    def take_second_sender(self) -> bool: ...

class Clock:
    def __init__(self) -> None: ...
    def now_s(self) -> float: ...
    def suspended_s(self) -> float: ...
    def sleep_until(self, time_s: float) -> None: ...

@final
class SteadyClock(Clock):
    def __init__(self) -> None: ...

@final
class Ros2Robot(Robot):
    def __init__(
        self,
        arm: str,
        rig: Rig,
        controller: Controller,
        clock: SteadyClock,
        *,
        enable_motion: bool = ...,
        setpoint_readers: int = ...,
        wait_s: float = ...,
        instrument: Optional[str] = ...,
    ) -> None: ...
    def state(self) -> JointState: ...
    def readings(self) -> list[tuple[float, _Array]]: ...

@final
class Ros2Camera(ImageStream):
    def __init__(self, topic: str, rig: Rig, clock: SteadyClock) -> None: ...
    dropped: str
    complaint: str

class Ros2Arm:
    def __init__(self, arm: str, joint_names: Sequence[str]) -> None: ...
    def publish(
        self,
        measured: ArrayLike,
        setpoint: ArrayLike,
        operating_state: str = ...,
        is_homed: bool = ...,
        is_busy: bool = ...,
    ) -> None: ...
    def new_setpoint(self) -> Optional[list[float]]: ...
    def new_commands(self) -> list[str]: ...
    malformed: int

class Ros2ImagePublisher:
    def __init__(self, topic: str) -> None: ...
    def publish(self, image: _Image, time_s: Optional[float] = ...) -> None: ...

class Trajectory:
    def __init__(
        self, duration_s: float, at: Callable[[float], tuple[ArrayLike, ArrayLike, ArrayLike]]
    ) -> None: ...
    duration_s: float
    def at(self, time_s: float) -> tuple[_Array, _Array, _Array]: ...

class Controller:
    def __init__(
        self,
        rig: Rig,
        *,
        mode: str = ...,
        path: Optional[_Path] = ...,
        period_s: float = ...,
        gains_per_s: Optional[ArrayLike] = ...,
        delay_s: Optional[float] = ...,
        window_margin_px: float = ...,
        joint_limits: Optional[Union[_Path, Sequence[ArrayLike]]] = ...,
    ) -> None: ...
    mode: str
    period_s: float
    def to_yaml(self) -> str: ...

class ControlTick:
    time_s: float
    joints: JointState
    desired: _Array
    action: str
    hold_reason: str
    error: Optional[_Array]
    features: Optional[_Array]
    q: Optional[_Array]
    velocity: _Array
    delay_s: float
    registration_contradicted: bool
    remedy: str
    sent: bool
    image: Optional[_Image]
    observations: tuple[Observation, ...]

class Renderer:
    def __init__(
        self,
        rig: Rig,
        *,
        blur_px: float = ...,
        noise: float = ...,
        light: float = ...,
        smoke: float = ...,
        film_m: float = ...,
        seed: int = ...,
    ) -> None: ...
    def render(self, q: ArrayLike, seed: int = ...) -> _Image: ...

@final
class Simulator(Robot, ImageStream, Clock):
    def __init__(
        self,
        rig: Rig,
        q: ArrayLike,
        *,
        seed: int = ...,
        frame_rate_hz: float = ...,
        latency_s: float = ...,
        exposure_s: float = ...,
        joint_offset: ArrayLike = ...,
        backlash: ArrayLike = ...,
    ) -> None: ...
    def step(self, dt_s: float) -> None: ...
    true_q: _Array
    def set_light(self, light: float) -> None: ...
    def cover_marker(self, begin_s: float, end_s: float) -> None: ...

def camera_from_marker(instrument: Instrument, q: ArrayLike) -> _Array: ...
def design_marker(
    diameter_m: float,
    *,
    length_m: Optional[float] = ...,
    min_band_m: Optional[float] = ...,
    hues_deg: ArrayLike = ...,
    focal_px: float = ...,
    distance_m: float = ...,
    print_error_m: float = ...,
) -> Marker: ...
def estimate_rcm(observations: Sequence[Observation], *, common_px: float = ...) -> RcmEstimate: ...
def load_trajectory(path: _Path) -> Trajectory: ...
def open_frames(
    input: _Path,
    fps: float = ...,
    deinterlaced: bool = ...,
    colour_matrix: str = ...,
    chroma_location: str = ...,
    image_topic: str = ...,
) -> FrameSource: ...
def paper_trajectory() -> Trajectory: ...
def print_marker(
    path: _Path, marker: Marker, *, instrument: str = ..., paper: str = ..., copies: int = ...
) -> None: ...
def read_image(path: _Path) -> _Image: ...
def run(
    robot: Robot,
    images: ImageStream,
    clock: Clock,
    rig: Rig,
    trajectory: Trajectory,
    duration_s: float,
    *,
    controller: Optional[Controller] = ...,
    rcm_px: Optional[ArrayLike] = ...,
    own_thread: bool = ...,
    on_tick: Optional[Callable[[ControlTick], Optional[bool]]] = ...,
) -> None: ...
def set_point(features: ArrayLike) -> Trajectory: ...
def sinusoids(
    offset: ArrayLike, amplitude: ArrayLike, omega_rad_s: ArrayLike, phase_rad: ArrayLike = ...
) -> Trajectory: ...
def via_points(points: ArrayLike, max_rate: ArrayLike, dwell_s: float = ...) -> Trajectory: ...
