from enum import Enum

class Status(Enum):
    ok = "ok"
    no_marker = "no_marker"
    cut = "cut"
    occluded = "occluded"
    ambiguous = "ambiguous"
    poor_fit = "poor_fit"
    uncertain = "uncertain"
    marker_mismatch = "marker_mismatch"
    damaged = "damaged"
    few_colors = "few_colors"
    interlaced = "interlaced"
