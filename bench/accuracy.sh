#!/usr/bin/env bash
# accuracy.sh [FRAMES]: measures the table of docs/notes/accuracy.md on frames that lapservo renders itself, or, given the
# folder of ray-traced samples, on those. Prints the rows; fails in the end where a row is ok beyond the
# limits that ok has without tolerance_m and sigma_bands_ in the rig.
# LAPSERVO_TIMES=20 renders 20 times as many frames, LAPSERVO_SEED=1000 adds so much to their seeds. Needs build/lapservo.
set -euo pipefail
cd "$(dirname "$0")/.."
lapservo=$PWD/build/lapservo
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
methods=(surface centerline)

failed=0
evaluate() { awk -f bench/evaluate.awk "$@" || { [ $? -eq 1 ] && failed=1; } || exit 2; }

header() {
  echo "| set, method | instruments | found | psi mean [mrad] | std | rms | largest | theta, phi rms [mrad] | rho rms [mm] | e0..e3 rms [px] | z | wrong |"
  echo "| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |"
}

# track INPUT RIG OUT OPTION...: status 1 says that nothing was found, which is a result.
track() {
  local input=$1 rig=$2 out=$3
  shift 3
  "$lapservo" track "$input" --rig "$rig" --out "$out" "$@" >"$scratch/log" 2>&1 || [ $? -eq 1 ] || { cat "$scratch/log" >&2; exit 2; }
}

# rendered NAME COUNT SEED OPTION...: of `lapservo render`; --video frames are tracked, others looked at one by one.
rendered() {
  local name=$1 rig=${rig:-configs/example.yaml} folder=$scratch/frames input method options=(--single)
  local count=$(($2 * ${LAPSERVO_TIMES:-1})) seed=$(($3 + ${LAPSERVO_SEED:-0}))
  shift 3
  rm -rf "$folder"
  "$lapservo" render --rig "$rig" --out "$folder" --count "$count" --seed "$seed" "$@" >/dev/null 2>&1
  input=$folder
  [[ " $* " == *" --video "* ]] && input=$folder/video.mp4
  [[ " $* " == *" --moving "* ]] && options=()
  for method in "${methods[@]}"; do
    track "$input" "$folder/rig.yaml" "$scratch/obs.csv" --method "$method" "${options[@]}"
    evaluate -v name="$name, $method" "$folder/truth.csv" "$scratch/obs.csv"
  done
}

render_all() {
  sed 's/distortion_coefficients: .*/distortion_coefficients: {rows: 1, cols: 5, data: [-0.28, 0.09, 0.0006, -0.0004, 0]}/' configs/example.yaml >"$scratch/distorted.yaml"
  rendered "usual" 60 101
  rig=$scratch/distorted.yaml rendered "distorted lens" 40 102
  rendered "dark (--light 0.15)" 40 103 --light 0.15
  rendered "overexposed (--light 1.7)" 40 104 --light 1.7
  rendered "blood (--blood 0.2)" 40 105 --blood 0.2
  rendered "smoke (--smoke 0.55)" 40 106 --smoke 0.55
  rendered "defocus (--blur-px 2.2)" 40 107 --blur-px 2.2
  rendered "noise (--noise 4)" 40 108 --noise 4
  rendered "JPEG (--format jpg)" 40 109 --format jpg
  rendered "video (--moving --video)" 150 110 --moving --video
}

# The rig of a frame is NNNN.rig.yaml, else the folder's rig.yaml.
sample_set() {
  local set=$1 name=$2 method frame stem pairs
  for method in "${methods[@]}"; do
    pairs=()
    if [ -e "$set/video.mp4" ]; then
      track "$set/video.mp4" "$set/rig.yaml" "$scratch/obs.csv" --single --method "$method"
      pairs=("$set/truth.csv" "$scratch/obs.csv")
    else
      for frame in "$set"/[0-9]*.{png,jpg}; do
        [ -e "$frame" ] || continue
        stem=$(basename "${frame%.*}")
        local rig=$set/$stem.rig.yaml
        [ -e "$rig" ] || rig=$set/rig.yaml
        track "$frame" "$rig" "$scratch/$stem.csv" --single --method "$method"
        awk -F, -v file="$(basename "$frame")" 'NR == 1 || $1 == file' "$set/truth.csv" >"$scratch/$stem.truth.csv"
        pairs+=("$scratch/$stem.truth.csv" "$scratch/$stem.csv")
      done
    fi
    evaluate -v name="$name, $method" "${pairs[@]}"
  done
}

# Processing of an image by cameras: response and aberration measured on boards of the same camera, where there are any;
# the lens is the frames' own.
pipeline_set() {
  local frames=$1 condition rig file stem pairs
  for condition in $(awk -F, 'NR > 1 && !seen[$3]++ { print $3 }' "$frames/pipeline/truth.csv"); do
    rig=$frames/pipeline/rig.yaml pairs=()
    if [ -d "$frames/boards/$condition" ]; then
      "$lapservo" calibrate camera "$frames/boards/$condition" --board 9x6 --square-mm 5 --camera-info "$scratch/camera.yaml" >/dev/null
      grep -E '^(response|lateral_chromatic_aberration):' "$scratch/camera.yaml" | sed 's/^/  /' >"$scratch/measured"
      sed -e "/^  response/r $scratch/measured" -e '/^  response/d' "$rig" >"$scratch/rig.yaml"
      rig=$scratch/rig.yaml
    elif [ "$condition" = interlaced ]; then
      sed 's/^  response/  deinterlace: true\n&/' "$rig" >"$scratch/rig.yaml"
      rig=$scratch/rig.yaml
    fi
    for file in $(awk -F, -v condition="$condition" '$3 == condition { print $1 }' "$frames/pipeline/truth.csv"); do
      stem=${file%.*}
      track "$frames/pipeline/$file" "$rig" "$scratch/$stem.csv" --single
      awk -F, -v file="$file" 'NR == 1 || $1 == file' "$frames/pipeline/truth.csv" >"$scratch/$stem.truth.csv"
      pairs+=("$scratch/$stem.truth.csv" "$scratch/$stem.csv")
    done
    evaluate -v name="pipeline: $condition, surface" "${pairs[@]}"
  done
}

header
if [ $# -eq 0 ]; then
  render_all
else
  for set in rotation illumination tilt two distorted video stress; do sample_set "$1/$set" "$set"; done
  pipeline_set "$1"
fi
exit "$failed"
