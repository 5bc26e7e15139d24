"""See and steer a laparoscopic instrument by its camera.

Arrays are numpy's; lengths are metres, angles radians, images uint8[H, W, 3] in blue green red as OpenCV has them.
Configurations q are theta, phi, rho, psi; features are s, r, l, d (docs/frames.md).
"""

try:
    from ._lapservo import __version__
except ImportError as error:
    import sys

    raise ImportError(
        f"{error}: lapservo is built for Debian's Python, run /usr/bin/python3 (this is {sys.executable})"
    ) from error

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
from ._lapservo import *  # noqa: F403, all that this build has: __init__.pyi lists it
from ._observation import Sigmas
from ._status import Status

__all__ = [name for name in dir() if not name.startswith("_")]

for _name in __all__:
    globals()[_name].__module__ = __name__
del _name
