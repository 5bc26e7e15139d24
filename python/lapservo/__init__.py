"""See and steer a laparoscopic instrument by its camera.

Arrays are numpy's; lengths are metres, angles radians, pictures uint8[H, W, 3] in blue green red as OpenCV has them.
Configurations q are theta, phi, rho, psi; features are s, r, l, d (docs/frames.md).
"""

from ._calibration import (
    CalibratedNumber,
    Calibration,
    CameraCalibration,
    ColourCalibration,
    MarkerCalibration,
    RegistrationCalibration,
    calibrate_camera,
    calibrate_colour,
    calibrate_marker,
    calibrate_registration,
)
from ._display import Picture
from ._errors import InputError
from ._lapservo import (
    Camera,
    Clock,
    Controller,
    ControlTick,
    Frame,
    FrameSource,
    ImageStream,
    Instrument,
    JointPath,
    Joints,
    JointState,
    Kinematics,
    Marker,
    MarkerPose,
    Observation,
    RcmEstimate,
    Renderer,
    Rig,
    Robot,
    Simulator,
    SteadyClock,
    Tracker,
    Trajectory,
    __version__,
    camera_from_marker,
    design_marker,
    estimate_rcm,
    load_trajectory,
    open_frames,
    paper_trajectory,
    print_marker,
    read_image,
    run,
    set_point,
    sinusoids,
    via_points,
)
from ._status import Status

__all__ = [name for name in dir() if not name.startswith("_")]

for _name in __all__:
    globals()[_name].__module__ = __name__
del _name
