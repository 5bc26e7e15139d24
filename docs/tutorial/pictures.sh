#!/bin/sh
# Makes the pictures of docs/tutorial.md with the tools themselves, from the recordings of their test.
# Usage: docs/tutorial/pictures.sh [BUILD]     needs chromium for the page
set -eu
here=$(cd "$(dirname "$0")" && pwd)
build=$(cd "${1:-build}" && pwd)
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

# Everything that the page's commands make; what the test says of pictures that are missing does not count here.
LAPSERVO_TUTORIAL_FOLDER=$work "$build/acceptance/tutorial_test" --gtest_filter='*EveryCommand*' || true

cp "$work/marker.png" "$here/marker.png"
# A frame as JPEG, so that the overlay is one.
sed -n '1p;30p' "$work/swing_poses.csv" >"$work/one.csv"
"$build/lapservo" render --rig "$work/truth.yaml" --poses "$work/one.csv" --format jpg --out "$work/one"
"$build/lapservo" track "$work/one" --rig "$work/rig.yaml" --out "$work/one.obs.csv" --overlay "$work/one.overlay"
cp "$work/one.overlay/0000.jpg" "$here/overlay.jpg"
chromium --headless --no-sandbox --disable-gpu --force-device-scale-factor=0.6 --window-size=1150,1500 \
  --screenshot="$here/check.png" "file://$work/check.html"
ls -l "$here"
