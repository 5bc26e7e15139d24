#!/usr/bin/env bash
# source.sh FOLDER: writes lapservo-VERSION.tar.xz of the committed files there: the same bytes for the same commit, on
# any machine at any time. `git get-tar-commit-id` gives the commit.
set -euo pipefail
out=$(realpath "$1")
cd "$(dirname "$0")/.."
version=$(git show HEAD:CMakeLists.txt | sed -n 's/^project(lapservo VERSION \([0-9.]*\).*/\1/p')
archive=$out/lapservo-$version.tar.xz
git -c tar.umask=0022 -c core.autocrlf=false archive --format=tar --prefix="lapservo-$version/" HEAD | xz -9 --threads=1 >"$archive.part"
mv "$archive.part" "$archive"
echo "$archive"
