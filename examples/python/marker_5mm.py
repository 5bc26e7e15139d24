"""marker_5mm.py SHEET.pdf: a marker for a 5 mm instrument, as a sheet to print, and what to expect of it."""

import sys

import numpy as np

import lapservo

if len(sys.argv) != 2:
    sys.exit(__doc__)
marker = lapservo.design_marker(0.005, focal_px=1100, distance_m=0.08)
lapservo.print_marker(sys.argv[1], marker, instrument="5 mm grasper", copies=6)
sigmas = [marker.predicted_sigma_rad(tau, focal_px=1100, distance_m=0.08) for tau in np.arange(0.1, 6.2, 0.1)]
print(f"{1000 * marker.length_m:.1f} mm long; sigma of the rotation {1000 * np.median(sigmas):.2f} mrad, "
      f"{1000 * max(sigmas):.2f} mrad where it is largest")
