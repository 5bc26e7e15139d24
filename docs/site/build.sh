#!/usr/bin/env bash
# build.sh BUILD [external]: the site from docs/*.md, the public headers, BUILD/python and BUILD/reference/cli.md, into
# BUILD/docs/html, loaded in a browser. A warning is an error, a dead link too; links to other sites are checked only with
# `external`.
set -euo pipefail
build=$(realpath "$1")
cd "$(dirname "$0")/../.."
out=$build/docs
rm -rf "$out"
mkdir -p "$out/doxygen" "$out/source"

headers=$(sed -n 's/^#include "\(lapservo\/.*\)"/\1/p' lapservo/lapservo.h | paste -sd ' ')
export LAPSERVO_DOXYGEN_XML=$out/doxygen/xml
{
  cat docs/site/Doxyfile
  printf 'INPUT = %s\nSTRIP_FROM_PATH = %s\nOUTPUT_DIRECTORY = %s\n' "$headers" "$PWD" "$out/doxygen"
} | doxygen -
# Pages are added to a copy. Debian's Python has Sphinx, and the module is built for it.
cp -r docs "$out/source/docs"
rm -r "$out/source/docs/site"
ln -s "$PWD/examples" "$PWD/transports" "$out/source"
sphinx() {
  PYTHONDONTWRITEBYTECODE=1 PYTHONPATH=$build/python /usr/bin/python3 -m sphinx -q -W --keep-going -c docs/site -d "$out/doctrees" "$@"
}
sphinx -b html "$out/source/docs" "$out/html"

# Debian's theme takes a style sheet from a web server's /javascript, and its script is a module, which browsers refuse in files.
static=$out/html/_static
{ cat /usr/share/javascript/normalize.css/normalize.css; sed '/^@import /d' "$static/styles/furo.css"; } >"$out/furo.css"
{ cat "$static/scripts/gumshoe-patched.js"; sed '/^import /d' "$static/scripts/furo.js"; } >"$out/furo.js"
mv "$out/furo.css" "$static/styles/furo.css"
mv "$out/furo.js" "$static/scripts/furo.js"

docs/site/check_links.py "$out/html" .
docs/site/test_site.py "$out/html"
[ "${2:-}" != external ] || sphinx -b linkcheck "$out/source/docs" "$out/links"
