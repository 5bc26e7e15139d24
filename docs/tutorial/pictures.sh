#!/bin/sh
# Makes the pictures of docs/tutorial.md and docs/tip_tutorial.md by the commands of the page.
# Usage: docs/tutorial/pictures.sh [BUILD]     needs chromium and ffmpeg
set -eu
here=$(cd "$(dirname "$0")" && pwd)
build=$(cd "${1:-build}" && pwd)
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

export PATH="$build:$PATH"
AUTOPKGTEST_TMP=$work "$here/../../debian/tests/pages" "$here/../tutorial.md"
cd "$work/tutorial/morning"
cp marker.png "$here/marker.png"
ffmpeg -loglevel error -y -ss 1 -i overlay.mp4 -frames:v 1 -q:v 4 "$here/overlay.jpg"
chromium --headless --no-sandbox --disable-gpu --force-device-scale-factor=0.6 --window-size=1150,1500 \
  --screenshot="$here/check.png" "file://$PWD/check.html"
mkdir "$work/tip"
cd "$work/tip"
ln -s "$here/../../configs" "$here/../../examples" .
sed -n '/^```sh$/,/^```$/{//!p}' "$here/../tip_tutorial.md" | PYTHONPATH="$build/python" sh -eu
cp circle.png "$here/circle.png"
ls -l "$here"
