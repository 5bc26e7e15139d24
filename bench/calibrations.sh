#!/usr/bin/env bash
# calibrations.sh [WIDTH [HEIGHT [SECONDS [TOOL...]]]]: how long each calibration takes for a recording of a minute (30 frames a
# second, H.264, rendered once and kept in build/calibrations), as rows of docs/performance.md. TOOL: camera, colour,
# marker, registration, check; all without any. Needs build/lapservo and build/bench/board_video.
set -euo pipefail
cd "$(dirname "$0")/.."
lapservo=$PWD/build/lapservo
width=${1:-1280} height=${2:-720} seconds=${3:-60}
shift $(($# < 3 ? $# : 3))
tools=("${@:-all}")
folder=$PWD/build/calibrations/${width}x${height}_$seconds
mkdir -p "$folder"
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT

# The example's rig before a camera of that size.
scaled_rig() {
  local scale
  scale=$(awk "BEGIN { print $width / 1280 }")
  sed -e "s/image_width: .*/image_width: $width/; s/image_height: .*/image_height: $height/" \
    -e "s/^  camera_matrix: .*/  camera_matrix: {rows: 3, cols: 3, data: [$(awk "BEGIN { f = 1100 * $scale; printf \"%g, 0, %g, 0, %g, %g, 0, 0, 1\", f, $width / 2 - 0.5, f, $height / 2 - 0.5 }")]}/" \
    configs/example.yaml
  echo "    image_delay_s: 0"
  echo "    joints: {names: [yaw, pitch, insertion, roll], sign: [1, 1, 1, 1], offset: [0, 0, 0, 0]}"
}

# recorded NAME EXPRESSIONS: the joints' course, a C-like list of theta, phi, rho, psi by t in seconds, as video and CSV.
recorded() {
  [ -e "$folder/$1.mp4" ] && return
  local rows='BEGIN { for (i = from; i < to; i++) { t = i / rate; if (stamped) printf "%g,", t; printf "%.8g,%.8g,%.8g,%.8g\n", '"$2"' } }'
  { echo theta_rad,phi_rad,rho_m,psi_rad; awk -v from=0 -v to=$((30 * seconds)) -v rate=30 "$rows"; } >"$scratch/poses.csv"
  { echo time_s,yaw,pitch,insertion,roll; awk -v stamped=1 -v from=-50 -v to=$((50 * seconds + 50)) -v rate=50 "$rows"; } >"$folder/$1.csv"
  "$lapservo" render --rig "$folder/rig.yaml" --out "$scratch/$1" --poses "$scratch/poses.csv" --video >/dev/null 2>&1
  mv "$scratch/$1/video.mp4" "$folder/$1.mp4"
}

make_recordings() {
  scaled_rig >"$folder/rig.yaml"
  recorded turn "-0.0778 + 0.02 * sin(0.5 * t), 1.75 + 0.02 * cos(0.4 * t), 0.140, -3.3 + 6.6 * t / $seconds"
  recorded swing "-0.0778 + 0.25 * sin(0.9 * t), 1.75 + 0.18 * sin(1.3 * t + 1), 0.140 + 0.010 * sin(0.7 * t), 3 * sin(0.5 * t + 2)"
  if [ ! -e "$folder/board.mp4" ]; then
    build/bench/board_video "$folder/rig.yaml" "$scratch/board.mp4" "$seconds"
    mv "$scratch/board.mp4" "$folder/board.mp4"
  fi
}

# measured TOOL ARGUMENT...: one row; a tool that refuses or complains says why.
measured() {
  local tool=$1 status=0 TIMEFORMAT='%R %U %S'
  shift
  [[ " ${tools[*]} " == *" all "* || " ${tools[*]} " == *" ${tool##* } "* ]] || return 0
  { time "$lapservo" $tool "$@" >"$scratch/said" 2>"$scratch/progress"; } 2>"$scratch/time" || status=$?
  read -r real user system <"$scratch/time"
  echo "| $tool | ${width}x$height | $real | $(awk "BEGIN { print $user + $system }") | $status |"
  [ "$status" -eq 0 ] || { tail -n 3 "$scratch/said"; tail -n 3 "$scratch/progress"; } >&2
}

make_recordings
echo "| tool | pictures | elapsed [s] | CPU [s] | exit |"
echo "| --- | --- | --- | --- | --- |"
rig=$folder/rig.yaml out=$scratch/rig.yaml
measured "calibrate camera" "$folder/board.mp4" --board 9x6 --square-mm 5 --out "$scratch/camera.yaml"
measured "calibrate colour" "$folder/swing.mp4" --rig "$rig" --out "$out"
measured "calibrate marker" "$folder/turn.mp4" --rig "$rig" --out "$out"
measured "calibrate registration" "$folder/swing.mp4" --joints "$folder/swing.csv" --rig "$rig" --out "$out"
measured "check" "$folder/swing.mp4" --joints "$folder/swing.csv" --rig "$rig"
