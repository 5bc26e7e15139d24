#!/usr/bin/env bash
# report.sh BENCH.json: writes the medians of a run of lapservo_bench into docs/performance.md and README.md (between their
# marks). Needs jq. CPU times of one run, so that ratios mean something.
set -euo pipefail
json=$1
page=$(dirname "$0")/../docs/performance.md
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT

# name, width, height, instruments, milliseconds: one line a benchmark.
jq -r '
  def ms: .cpu_time * {"ns": 1e-6, "us": 1e-3, "ms": 1, "s": 1e3}[.time_unit];
  def argument(key): (.run_name | capture("/" + key + ":(?<v>[0-9]+)") // {v: "-"}).v;
  .benchmarks[] | select(.aggregate_name == "median")
  | [(.run_name | sub("/width:.*"; "")), argument("width"), argument("height"), argument("instruments"), ms]
  | @tsv' "$json" > "$scratch/medians"
[ -s "$scratch/medians" ] || { echo "report.sh: $json holds no medians; run with --benchmark_repetitions" >&2; exit 2; }

awk -F'\t' '
  function cell(name, width, instruments) { return (name, width, instruments) in ms ? ms[name, width, instruments] : "" }
  function shown(x) { return x == "" ? "" : sprintf(x < 0.1 ? "%.3f" : x < 10 ? "%.2f" : "%.0f", x) }
  function row(title, name, instruments,   i, line) {
    line = "| " title " |"
    for (i = 1; i <= sizes; ++i) line = line " " shown(cell(name, width[i], instruments)) " |"
    print line
  }
  { ms[$1, $2, $4] = $5; if ($2 != "-" && !($2 in seen)) { seen[$2] = $3; width[++sizes] = $2 } }
  END {
    for (i = 1; i <= sizes; ++i)
      for (j = i + 1; j <= sizes; ++j)
        if (width[j] + 0 < width[i] + 0) { w = width[i]; width[i] = width[j]; width[j] = w }
    printf "| Milliseconds |"
    for (i = 1; i <= sizes; ++i) printf " %sx%s |", width[i], seen[width[i]]
    printf "\n| --- |"
    for (i = 1; i <= sizes; ++i) printf " ---: |"
    print ""
    for (n = 1; n <= 3; ++n) row("Cold detection and fit, " n, "cold", n)
    for (n = 1; n <= 3; ++n) row("Tracked frame, " n, "tracked", n)
    row("Cold, marker of fixed size in pixels", "cold_fixed_marker", "-")
    row("Tracked, marker of fixed size in pixels", "tracked_fixed_marker", "-")
    row("Search without a marker", "search_without_marker", "-")
    row("Fit alone", "fit", "-")
    for (n = 1; n <= 3; ++n) row("Renderer, " n, "render", n)
    row("memcpy of the frame", "copy_frame", "-")
    row("BGR to HSV (OpenCV)", "hsv_of_frame", "-")
    row("HSV, three ranges, opening, components (OpenCV)", "textbook", "-")
    row("aruco (OpenCV)", "aruco", "-")
    row("AprilTag, decimate 2", "apriltag/decimate_2", "-")
    row("AprilTag, decimate 1", "apriltag/decimate_1", "-")
  }' "$scratch/medians" > "$scratch/table"

# between_marks FILE TEXT: TEXT in place of what stands between the marks in FILE.
between_marks() {
  awk -v text="$2" '
    /<!-- measured -->$/ { print; while ((getline line < text) > 0) print line; skipping = 1 }
    /<!-- \/measured -->$/ { skipping = 0 }
    !skipping' "$1" > "$scratch/whole"
  cp "$scratch/whole" "$1"
}
{
  jq -r '.context | "Measured \(.date | .[0:10]) on \(.num_cpus) x \(.mhz_per_cpu) MHz, load \(.load_avg[0] // "unknown"); medians of CPU time.\n"' "$json"
  cat "$scratch/table"
} > "$scratch/measured"
between_marks "$page" "$scratch/measured"
"$(dirname "$0")/readme_figures.sh" "$page" > "$scratch/sentence"
between_marks "$(dirname "$0")/../README.md" "$scratch/sentence"
