#!/usr/bin/env bash
# test_manual.sh TOOL FOLDER: roff finds nothing to warn of in FOLDER's manual pages; there is one for each command, and each has
# every option of that command's help.
set -euo pipefail
tool=$1 folder=$2 failed=0 count=0

check_command() {
  local help page text option sub
  help=$("$tool" "$@" --help)
  page=$folder/$(IFS=-; echo "lapservo${*:+-$*}").1
  count=$((count + 1))
  text=$(LC_ALL=C groff -man -ww -Tascii -P-cbou -rLL=200n "$page" 2>"$page.warnings")
  if [ -s "$page.warnings" ]; then cat "$page.warnings"; failed=1; fi
  rm "$page.warnings"
  for option in $(grep -oE '^  (-[a-z],)?--[a-z-]+' <<<"$help" | grep -oE -- '--[a-z-]+'); do
    grep -qF -- "$option" <<<"$text" || { echo "$page lacks $option"; failed=1; }
  done
  for sub in $(sed -n '/^Subcommands:/,/^$/s/^  \([a-z-]*\) .*/\1/p' <<<"$help"); do check_command "$@" "$sub"; done
}

check_command
pages=("$folder"/*.1)
[ ${#pages[@]} -eq "$count" ] || { echo "${#pages[@]} pages for $count commands"; failed=1; }
exit $failed
