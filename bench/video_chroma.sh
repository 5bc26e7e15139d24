#!/usr/bin/env bash
# video_chroma.sh [FOLDER]: accuracy in compressed video, by codec and by the place of chroma's samples (4:2:0, decimated
# as ffmpeg does by default). Frames that lapservo renders itself, or those of a folder with NNNN.png, rig.yaml and
# truth.csv. Prints rows of docs/notes/accuracy.md. Needs build/lapservo and ffmpeg with libx264 and libx265.
set -euo pipefail
cd "$(dirname "$0")/.."
lapservo=$PWD/build/lapservo
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT

frames=${1:-$scratch/frames}
[ $# -gt 0 ] || "$lapservo" render --rig configs/example.yaml --count 60 --seed 701 --out "$frames" >/dev/null 2>&1

# Offsets are in 256ths of a pixel of luma.
encode() { # CODEC PLACE FILE
  local across=0 down=128 format=yuv420p range=tv matrix=bt709 tag=bt709 options=(-g 1 -crf 18)
  case $2 in topleft) down=0 ;; center) across=128 ;; esac
  case $1 in
    libx265) options=(-x265-params keyint=1:crf=18:log-level=none) ;;
    mjpeg) format=yuvj420p range=pc matrix=bt601 tag=smpte170m options=(-q:v 2) ;;
  esac
  ffmpeg -v error -y -framerate 30 -i "$frames/%04d.png" \
    -vf "scale=out_color_matrix=$matrix:out_range=$range:out_h_chr_pos=$across:out_v_chr_pos=$down:flags=bicubic+accurate_rnd+full_chroma_inp,format=$format" \
    -c:v "$1" "${options[@]}" -colorspace "$tag" -color_primaries bt709 -color_trc iec61966-2-1 -color_range "$range" \
    -chroma_sample_location "$2" "$3"
}

# measure CODEC PLACE...
measure() {
  local codec=$1 place
  for place in "${@:2}"; do
    encode "$codec" "$place" "$scratch/video.mkv"
    "$lapservo" track "$scratch/video.mkv" --rig "$frames/rig.yaml" --out "$scratch/obs.csv" --single >"$scratch/log" 2>&1 || [ $? -eq 1 ]
    awk -f bench/evaluate.awk -v name="$codec, $place" "$frames/truth.csv" "$scratch/obs.csv"
  done
}

echo "| codec, chroma | instruments | found | psi mean [mrad] | std | rms | largest | theta, phi rms [mrad] | rho rms [mm] | e0..e3 rms [px] | z | wrong |"
echo "| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |"
measure libx264 left topleft center
measure libx265 left topleft center
measure mjpeg center  # where JPEG has it
