#!/usr/bin/env bash
# readme_figures.sh PERFORMANCE.md: README's sentence on speed, by the column 1280x720 of that page's table.
# readme_figures.sh PERFORMANCE.md README.md: fails when README.md has another one.
set -euo pipefail
sentence=$(awk -F' *[|] *' '
  /^\| Milliseconds/ { for (i = 1; i <= NF; ++i) if ($i == "1280x720") column = i }
  column { ms[$2] = $column }
  END {
    printf "  One frame of 1280x720 costs, on one core (`./dev bench`): %s ms when the instrument must be found,\n", ms["Cold detection and fit, 1"]
    printf "  %s ms when it is tracked, %s ms when there is nothing to see; copying the frame takes %s ms, AprilTag\n",
           ms["Tracked frame, 1"], ms["Search without a marker"], ms["memcpy of the frame"]
    printf "  (decimate 2) %s ms.\n", ms["AprilTag, decimate 2"]
  }' "$1")
[ $# -eq 1 ] && { echo "$sentence"; exit; }
diff <(echo "$sentence") <(awk '/<!-- \/measured -->$/ { inside = 0 } inside; /<!-- measured -->$/ { inside = 1 }' "$2")
