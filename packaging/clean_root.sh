#!/usr/bin/env bash
# clean_root.sh FOLDER [RELEASE]: installs the packages in FOLDER by apt into a bare Debian 12 of its own, or that release, for which they
# were built, and runs debian/tests there, where nothing of the source tree is. Exit code 77, with the reason, where there can be no such root.
set -euo pipefail
debs=$(realpath "$1") release=${2:-bookworm}
cd "$(dirname "$0")/.."
skip() {
  echo "skipped: $*"
  exit 77
}
[ "$(id -u)" -eq 0 ] || skip "a root of its own needs root"
command -v mmdebstrap >/dev/null || skip "mmdebstrap is not installed"
mirror=${LAPSERVO_MIRROR:-http://deb.debian.org/debian}
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
timeout 60 /usr/lib/apt/apt-helper download-file "$mirror/dists/$release/Release" "$work/Release" >/dev/null 2>&1 ||
  skip "the mirror $mirror can't be reached"

tests=$(sed -n 's/^Tests: //p' debian/tests/control | tr ',' ' ')
needed=$(sed -n 's/^Depends: //p' debian/tests/control | tr ',' '\n' | grep -v '@' | tr -d ' ' | sort -u | paste -sd ' ')
hooks=(
  --customize-hook='mkdir "$1/packages" "$1/tests"'
  --customize-hook="cp $debs/*.deb \"\$1/packages\""
  --customize-hook='chmod -R a+rX "$1/packages"'
  --customize-hook="chroot \"\$1\" sh -c 'apt-get -q install -y --no-install-recommends /packages/*.deb $needed >/log 2>&1 || { tail -n 40 /log; exit 1; }'"
  --customize-hook='chroot "$1" useradd --create-home tester'
)
for test in $tests; do
  hooks+=(
    --customize-hook="install -m 755 debian/tests/$test \"\$1/tests/$test\""
    --customize-hook="echo '== $test'; chroot \"\$1\" su tester -c 'export AUTOPKGTEST_TMP=\$(mktemp -d) && cd \$AUTOPKGTEST_TMP && /tests/$test'"
  )
done
mmdebstrap --quiet --variant=apt --dpkgopt=force-unsafe-io --format=null "${hooks[@]}" "$release" /dev/null "$mirror"
