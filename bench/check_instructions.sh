#!/usr/bin/env bash
# check_instructions.sh PROGRAM EXPECTED FOLDER: counts the instructions of PROGRAM's work (count_instructions.cpp) and fails when one
# exceeds EXPECTED (lines of "name instructions") by more than the tolerance, or when tracking a marker of the same size in pixels
# costs more in a wider image. Noise, load and clock do not change these counts; the compiler does.
# To accept new counts: check_instructions.sh PROGRAM EXPECTED FOLDER --store
set -euo pipefail
program=$1 expected=$2 folder=$3 store=${4:-}
tolerance_percent=3 wide_over_narrow=1.1

mkdir -p "$folder"
"$program" render "$folder"
counts=$folder/counts.txt
: > "$counts"
for what in cold tracked tracked_narrow tracked_wide; do
  valgrind --tool=callgrind --toggle-collect=counted_work --callgrind-out-file="$folder/callgrind.$what" \
    "$program" "$what" "$folder" 2> "$folder/valgrind.$what"
  echo "$what $(awk '/^(summary|totals):/ {print $2; exit}' "$folder/callgrind.$what")" >> "$counts"
done
[ "$store" = --store ] && cp "$counts" "$expected"
awk -v tolerance="$tolerance_percent" -v most="$wide_over_narrow" '
  NR == FNR { expected[$1] = $2; next }
  {
    count[$1] = $2
    change = 100 * ($2 / expected[$1] - 1)
    printf "%s: %d instructions, %+.2f %% of %d\n", $1, $2, change, expected[$1]
    if (!($2 > 0) || change > tolerance) { failed = 1; print "  more than " tolerance " %" }
    if (change < -tolerance) print "  fewer: store them, so that they stay"
  }
  END {
    ratio = count["tracked_wide"] / count["tracked_narrow"]
    printf "tracked_wide / tracked_narrow: %.2f, required <= %s\n", ratio, most
    exit failed || !(ratio <= most)
  }' "$expected" "$counts"
