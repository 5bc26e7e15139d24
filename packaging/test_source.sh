#!/usr/bin/env bash
# test_source.sh: the source archive is the same from two clones that differ in place, umask, time zone, locale and settings of git,
# and has all that is committed.
set -euo pipefail
cd "$(dirname "$0")/.."
if ! git rev-parse --quiet --verify HEAD >/dev/null 2>&1; then
  echo "not a checkout of git: there is nothing to make an archive of"
  exit 77
fi
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
mkdir "$work/1" "$work/2"
one=$(packaging/source.sh "$work/1")
(
  umask 077
  git clone --quiet --no-local "$PWD" "$work/clone"
  git -C "$work/clone" config tar.umask 0000
  git -C "$work/clone" config core.autocrlf true
  find "$work/clone" -name '*.md' -exec touch -d 2001-02-03 {} +
)
two=$(cd / && umask 077 && TZ=Asia/Tokyo LC_ALL=C GIT_CONFIG_GLOBAL=/dev/null "$work/clone/packaging/source.sh" "$work/2")
cmp "$one" "$two"
tar -tf "$one" | sed -n 's|^[^/]*/||; /[^/]$/p' | sort >"$work/archived"
git ls-tree -r --name-only HEAD | sort | diff - "$work/archived"
