#!/usr/bin/env bash
# check_instructions.sh PROGRAM EXPECTED FOLDER: fails when a frame costs more instructions than EXPECTED (lines of
# "name instructions") by more than the tolerance. Noise, load and clock do not change these counts; the compiler does.
# To accept new counts: check_instructions.sh PROGRAM EXPECTED FOLDER --store
set -euo pipefail
program=$1 expected=$2 folder=$3 store=${4:-}
tolerance_percent=3

mkdir -p "$folder"
"$program" render "$folder"
counts=$folder/counts.txt
: > "$counts"
for what in cold tracked; do
  valgrind --tool=callgrind --toggle-collect=counted_work --callgrind-out-file="$folder/callgrind.$what" \
    "$program" "$what" "$folder" 2> "$folder/valgrind.$what"
  echo "$what $(awk '/^(summary|totals):/ {print $2; exit}' "$folder/callgrind.$what")" >> "$counts"
done
[ "$store" = --store ] && cp "$counts" "$expected"
awk -v tolerance="$tolerance_percent" '
  NR == FNR { expected[$1] = $2; next }
  {
    change = 100 * ($2 / expected[$1] - 1)
    printf "%s: %d instructions, %+.2f %% of %d\n", $1, $2, change, expected[$1]
    if (!($2 > 0) || change > tolerance) failed = 1
    if (change < -tolerance) print "  fewer: store them, so that they stay"
  }
  END { exit failed }' "$expected" "$counts"
