#!/usr/bin/env bash
# build.sh BUILD [external]: the site from docs/*.md, the public headers and BUILD/reference/cli.md, into
# BUILD/docs/html. A warning is an error, a dead link too; links to other sites are checked only with `external`.
set -euo pipefail
build=$(realpath "$1")
cd "$(dirname "$0")/../.."
out=$build/docs
rm -rf "$out"
mkdir -p "$out/doxygen"

headers=$(sed -n 's/^#include "\(lapservo\/.*\)"/\1/p' lapservo/lapservo.h | paste -sd ' ')
export LAPSERVO_DOXYGEN_XML=$out/doxygen/xml
{
  cat docs/site/Doxyfile
  printf 'INPUT = %s\nSTRIP_FROM_PATH = %s\nOUTPUT_DIRECTORY = %s\n' "$headers" "$PWD" "$out/doxygen"
} | doxygen -
sphinx() {
  PYTHONDONTWRITEBYTECODE=1 sphinx-build -q -W --keep-going -c docs/site -d "$out/doctrees" "$@"
}
sphinx -b html docs "$out/html"
docs/site/check_links.py "$out/html" .
[ "${2:-}" != external ] || sphinx -b linkcheck docs "$out/links"
