#!/usr/bin/env bash
# test_completion.sh TOOL SCRIPT: what bash completes is what TOOL's help shows, for every command and every option that takes one
# of a few words.
set -euo pipefail
tool=$1
source "$2"
compopt() { offered=yes; }
failed=0

# complete WORDS...: the last word is the one under the cursor.
complete_words() {
  COMP_WORDS=(lapservo "$@") COMP_CWORD=$# COMPREPLY=() offered=
  _lapservo
}
# expect NAME EXPECTED: both sorted, one word a line.
expect() {
  local found
  found=$(printf '%s\n' "${COMPREPLY[@]}" | sort)
  [ "$found" = "$2" ] && return
  printf '%s: completed\n%s\nexpected\n%s\n' "$1" "$found" "$2"
  failed=1
}

check_command() {
  local help subcommands options line names choices sub name
  help=$("$tool" "$@" --help)
  options=$(grep -oE '^  (-[a-z],)?--[a-z-]+' <<<"$help" | tr -d ' ' | tr ',' '\n' | sort)
  complete_words "$@" -
  expect "lapservo $* -" "$options"
  while IFS= read -r line; do
    names=$(grep -oE '^  --[a-z-]+' <<<"$line" | tr -d ' ')
    choices=$(sed -E 's/.*:\{([^}]*)\}.*/\1/' <<<"$line" | tr ',' '\n' | sort)
    complete_words "$@" "$names" ""
    expect "lapservo $* $names" "$choices"
    complete_words "$@" "$names" = ""
    expect "lapservo $* $names=" "$choices"
  done < <(grep -E '^  --[a-z-]+ [A-Z]+:\{' <<<"$help" || true)
  for name in $(grep -oE '^  --[a-z-]+ TEXT( |=|$)' <<<"$help" | grep -oE -- '--[a-z-]+' || true); do
    complete_words "$@" "$name" ""
    [ "$offered" = yes ] || { echo "lapservo $* $name: completes no files"; failed=1; }
  done
  subcommands=$(sed -n '/^Subcommands:/,/^$/s/^  \([a-z-]*\) .*/\1/p' <<<"$help" | sort)
  if [ -n "$subcommands" ]; then
    complete_words "$@" ""
    expect "lapservo $*" "$subcommands"
  fi
  for sub in $subcommands; do check_command "$@" "$sub"; done
}

check_command
complete_words experiment ill
expect "lapservo experiment ill" illumination
complete_words calibrate all --turn reg
expect "lapservo calibrate all --turn reg" ""
exit $failed
