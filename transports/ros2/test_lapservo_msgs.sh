#!/usr/bin/env bash
# test_lapservo_msgs.sh MSG FOLDER: ROS 2's generators build the package lapservo_msgs of MSG, and a program includes its header. Debian
# has the generators, but not what it depends on: std_msgs and builtin_interfaces are made of the .msg files here.
set -euo pipefail
msg=$(realpath "$1")
rm -rf "$2" && mkdir -p "$2/prefix" && cd "$2"

# stand_in NAME CONTENT: a package of CMake's.
stand_in() {
  mkdir -p "prefix/share/$1/cmake"
  echo "$2" >"prefix/share/$1/cmake/$1Config.cmake"
}
# package NAME [DEPENDENCY]: as lapservo_msgs, of other types.
package() {
  local types
  cp -r "$msg/$1" .
  types=$(cd "$1" && echo msg/*.msg)
  sed "s/std_msgs/${2:-ament_cmake}/; s/lapservo_msgs/$1/" "$msg/lapservo_msgs/package.xml" >"$1/package.xml"
  sed "s/ DEPENDENCIES std_msgs/${2:+ DEPENDENCIES $2}/; s/std_msgs/${2:-ament_cmake}/; s/lapservo_msgs/$1/; s|msg/Observation.msg|$types|" \
    "$msg/lapservo_msgs/CMakeLists.txt" >"$1/CMakeLists.txt"
}
# The PATH: of a Python that has Debian's modules.
install() {
  env PATH=/usr/bin:/bin cmake -S "$1" -B "build/$(basename "$1")" -DCMAKE_PREFIX_PATH="$PWD/prefix" -DCMAKE_INSTALL_PREFIX="$PWD/prefix"
  env PATH=/usr/bin:/bin cmake --build "build/$(basename "$1")" --target install
}

stand_in rosidl_default_generators "find_package(rosidl_cmake REQUIRED)
find_package(rosidl_generator_c REQUIRED)
find_package(rosidl_generator_cpp REQUIRED)"
stand_in rosidl_default_runtime ""
package builtin_interfaces
install builtin_interfaces
package std_msgs builtin_interfaces
install std_msgs
install "$msg/lapservo_msgs"
echo '#include <lapservo_msgs/msg/observation.hpp>
int main() { return lapservo_msgs::msg::Observation().feature_covariance.size() == 16 ? 0 : 1; }' >see.cpp
g++ -std=c++17 -Iprefix/include see.cpp -o see $(printf -- '-I%s ' prefix/include/* /usr/include/rosidl*)
./see
