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

# encode CODEC PLACE FILE. Offsets are in 256ths of a pixel of luma.
encode() {
  local across down scale=yuv420p:tv:bt709:bt709 options=(-g 1 -crf 18)
  case $2 in left) across=0 down=128 ;; topleft) across=0 down=0 ;; center) across=128 down=128 ;; esac
  case $1 in
    libx265) options=(-x265-params keyint=1:crf=18:log-level=none) ;;
    mjpeg) scale=yuvj420p:pc:bt601:smpte170m options=(-q:v 2) ;;
  esac
  local format range matrix tag
  IFS=: read -r format range matrix tag <<<"$scale"
  ffmpeg -v error -y -framerate 30 -i "$frames/%04d.png" \
    -vf "scale=out_color_matrix=$matrix:out_range=$range:out_h_chr_pos=$across:out_v_chr_pos=$down:flags=bicubic+accurate_rnd+full_chroma_inp,format=$format" \
    -c:v "$1" "${options[@]}" -colorspace "$tag" -color_primaries bt709 -color_trc iec61966-2-1 -color_range "$range" \
    -chroma_sample_location "$2" "$3"
}

echo "| codec, chroma | instruments | found | psi mean [mrad] | std | rms | largest | theta, phi rms [mrad] | rho rms [mm] | e0..e3 rms [px] | z | wrong |"
echo "| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |"
for codec in libx264 libx265 mjpeg; do
  for place in left topleft center; do
    [ "$codec,$place" = mjpeg,left ] || [ "$codec,$place" = mjpeg,topleft ] && continue  # JPEG has it in the centre
    encode "$codec" "$place" "$scratch/video.mkv"
    "$lapservo" track "$scratch/video.mkv" --rig "$frames/rig.yaml" --out "$scratch/obs.csv" --single >"$scratch/log" 2>&1 || [ $? -eq 1 ]
    awk -f bench/evaluate.awk -v name="$codec, $place" "$frames/truth.csv" "$scratch/obs.csv"
  done
done
