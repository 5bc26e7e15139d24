#!/usr/bin/env bash
# debs.sh FOLDER [BUILD_TREE]: builds the Debian packages into FOLDER and runs lintian on them. Packages what is
# committed, with the source package; or, given a build tree (see debian/rules), the files built in it and the present
# files.
set -euo pipefail
mkdir -p "$1"
out=$(realpath "$1")
tree=${2:+$(realpath "$2")}
cd "$(dirname "$0")/.."
rm -rf "$out"/lapservo[-_]* "$out"/*.deb
version=$(sed -n 's/^project(lapservo VERSION \([0-9.]*\).*/\1/p' CMakeLists.txt)
source=$out/lapservo-$version
if [ -z "$tree" ]; then
  archive=$(packaging/source.sh "$out")
  cp "$archive" "$out/lapservo_$version.orig.tar.xz"
  tar -C "$out" -xf "$archive"
  (cd "$source" && dpkg-buildpackage --unsigned-source --unsigned-changes)
  rm -rf "$source"  # gigabytes of objects
else
  mkdir "$source"
  cp -r --parents CMakeLists.txt LICENSE README.md debian docs examples "$source"
  (cd "$source" && LAPSERVO_BUILD_TREE=$tree DEB_BUILD_OPTIONS=nocheck dpkg-buildpackage --no-check-builddeps --unsigned-changes --build=binary)
fi
lintian --allow-root --fail-on error --tag-display-limit 0 "$out"/lapservo_*.changes
