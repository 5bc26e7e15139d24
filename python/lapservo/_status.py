from enum import Enum


class Status(Enum):
    """Why there is, or is not, an observation."""

    ok = "ok"
    no_marker = "no_marker"
    cut = "cut"
    occluded = "occluded"
    ambiguous = "ambiguous"
    poor_fit = "poor_fit"
    uncertain = "uncertain"
    marker_mismatch = "marker_mismatch"
    damaged = "damaged"
    interlaced = "interlaced"
    blended = "blended"


_MEANINGS = {
    "ok": "measured: every number is there",
    "no_marker": "nothing in the image has the marker's colours in its order",
    "cut": "too little of the marker lies inside the image",
    "occluded": "too few of its boundaries are visible",
    "ambiguous": "two explanations fit about as well",
    "poor_fit": "something was found that does not look like the marker on closer sight",
    "uncertain": "found, but the rotation's standard deviation is too large to be of use",
    "marker_mismatch": "the print is not as the rig says: calibrate the marker",
    "damaged": "the decoder of the image or video complained: its pixels are not the camera's",
    "interlaced": "the frame is made of two fields, of two moments: use deinterlace",
    "blended": "the frame is the sum of two moments: noise reduction over time, or a converted frame rate",
}
for _status in Status:
    _status.__doc__ = _MEANINGS[_status.value]
Status.__doc__ = f"{Status.__doc__}\n\n" + "\n".join(f"{word}: {meaning}" for word, meaning in _MEANINGS.items())
