from enum import Enum


class Status(Enum):
    """Why there is, or is not, an observation."""

    _value_: str

    def __new__(cls, word: str, meaning: str) -> "Status":
        member = object.__new__(cls)
        member._value_ = word
        member.__doc__ = meaning
        return member

    ok = "ok", "measured: every number is there"
    no_marker = "no_marker", "nothing in the image has the marker's colours in its order"
    cut = "cut", "too little of the marker lies inside the image"
    occluded = "occluded", "too few of its boundaries are visible"
    ambiguous = "ambiguous", "two explanations fit about as well"
    poor_fit = "poor_fit", "something was found that does not look like the marker on closer sight"
    uncertain = "uncertain", "found, but the rotation's standard deviation is too large to be of use"
    marker_mismatch = "marker_mismatch", "the print is not as the rig says: calibrate the marker"
    damaged = "damaged", "the decoder of the image or video complained: its pixels are not the camera's"
    few_colors = "few_colors", "the image has no more colours than a palette: its pixels are not the camera's"
    interlaced = "interlaced", "the frame is made of two fields, of two moments: use deinterlace"


Status.__doc__ = f"{Status.__doc__}\n\n" + "\n".join(f"{status.value}: {status.__doc__}" for status in Status)
