#!/usr/bin/env bash
# colcon.sh RELEASE: builds and tests lapservo and lapservo_msgs by Debian's colcon, in a workspace in a bare root of that Debian release,
# and uses what the sourced workspace gives: the tool, the C++ package, the index of packages. Debian lacks what lapservo_msgs depends on:
# test_lapservo_msgs.sh makes it. FRESH_EXTRA: packages to install before, such as ccache.
set -euo pipefail
release=$1
cd "$(dirname "$0")/.."
[ "$(id -u)" -eq 0 ] || { echo "colcon: a root of its own needs root" >&2; exit 2; }
mirror=${LAPSERVO_MIRROR:-http://deb.debian.org/debian}
clone=$(mktemp -d)
trap 'rm -rf "$clone"' EXIT
git clone --quiet --no-local . "$clone/lapservo"
cat >"$clone/commands" <<'SCRIPT'
#!/bin/bash
set -eo pipefail
export CMAKE_GENERATOR=Ninja
mkdir -p ~/ws/src && cd ~/ws && mv ~/lapservo src
msgs=src/lapservo/transports/ros2/msg
src/lapservo/transports/ros2/test_lapservo_msgs.sh $msgs ~/dependencies >msgs.txt 2>&1 || { tail -n 40 msgs.txt; exit 1; }
rm -r ~/dependencies/prefix/{share,include}/lapservo_msgs
CMAKE_PREFIX_PATH=$HOME/dependencies/prefix colcon build --paths src/lapservo $msgs/lapservo_msgs \
  --cmake-args -DCMAKE_BUILD_TYPE=Release -DLAPSERVO_BUILD_TESTS=OFF
colcon test --packages-select lapservo --event-handlers console_direct+
colcon test-result --verbose
cd ~
. ws/install/local_setup.bash
set -x
[ "$(command -v lapservo)" = "$HOME/ws/install/lapservo/bin/lapservo" ]
lapservo render --rig ws/install/lapservo/share/lapservo/configs/paper.yaml --out frames --count 3 --moving
[[ :$AMENT_PREFIX_PATH: == *:$HOME/ws/install/lapservo:* ]]
[ -e ws/install/lapservo/share/ament_index/resource_index/packages/lapservo ]
[ -e ws/install/lapservo/share/lapservo/launch/servo.launch.py ]
[ -e ws/install/lapservo_msgs/share/lapservo_msgs/msg/Observation.msg ]
cmake -S ws/src/lapservo/examples/find_package -B consumer && cmake --build consumer
consumer/rotation ws/install/lapservo/share/lapservo/example/{rig.yaml,0000.png}
SCRIPT
chmod +x "$clone/commands"
packages=$(awk '$1 == "tool" || $1 == "parts" || $1 == "colcon" { $1 = ""; print }' cmake/debian-packages.txt | tr -s ' ' '\n' | sed '/^$/d' | paste -sd ,)
mmdebstrap --quiet --variant=apt --dpkgopt=force-unsafe-io --format=null --include="$packages${FRESH_EXTRA:+,$FRESH_EXTRA}" \
  --customize-hook="cp -r '$clone/lapservo' '$clone/commands' \"\$1/root\"" \
  --customize-hook='chroot "$1" env -i HOME=/root PATH="$PATH" LANG=C.UTF-8 /root/commands' \
  "$release" /dev/null "$mirror"
