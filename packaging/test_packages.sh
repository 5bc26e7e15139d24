#!/usr/bin/env bash
# test_packages.sh BUILD_TREE: packages what is built there, as debian/rules has it, and tries the packages in a clean root.
set -euo pipefail
tree=$(realpath "$1")
cd "$(dirname "$0")/.."
for tool in dpkg-buildpackage dh lintian; do
  command -v "$tool" >/dev/null || { echo "skipped: $tool is not installed (./dev package installs what it needs)"; exit 77; }
done
packaging/debs.sh "$tree/packages" "$tree"
packaging/clean_root.sh "$tree/packages"
