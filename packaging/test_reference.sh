#!/usr/bin/env bash
# test_reference.sh TOOL REFERENCE: each command of TOOL has a manual page, in which roff finds nothing to warn of and which has every
# option of the command's help, and a section of cli.md; bash completes its options, the words that these take, and its subcommands.
set -euo pipefail
tool=$1 reference=$2 failed=0 count=0
declare -A helps  # of each command, as completion asks for them hundreds of times
source "$(dirname "$0")/completion.bash"

known_help() { printf '%s\n' "${helps[$*]}"; }

complain() { echo "$*"; failed=1; }

# expect_completed EXPECTED WORD...: what the last word, under the cursor, becomes; one word a line, sorted.
expect_completed() {
  local expected=$1 found
  shift
  COMP_WORDS=(known_help "$@") COMP_CWORD=$# COMPREPLY=()
  _lapservo || true
  found=$(printf '%s\n' "${COMPREPLY[@]}" | sort)
  [ "$found" = "$expected" ] || complain "lapservo $*: completed" $found "expected" $expected
}

# expect_page NAME OPTIONS
expect_page() {
  local page=$reference/man1/$1.1 text option
  text=$(LC_ALL=C groff -man -ww -Tascii -P-cbou -rLL=200n "$page" 2>&1 >/dev/null) || true
  [ -z "$text" ] || complain "$text"
  text=$(LC_ALL=C groff -man -Tascii -P-cbou -rLL=200n "$page" 2>&1) || true
  for option in $2; do [[ $text == *"$option"* ]] || complain "$page lacks $option"; done
}

check_command() {
  local help options option choices sub subcommands
  count=$((count + 1))
  help=$("$tool" "$@" --help)
  helps["${*:+$* }--help"]=$help
  options=$(grep -oE '^  (-[a-z],)?--[a-z-]+' <<<"$help" | tr -d ' ' | tr ',' '\n' | sort)
  expect_page "$(IFS=-; echo "lapservo${*:+-$*}")" "$options"
  grep -qxF "## lapservo${*:+ $*}" "$reference/cli.md" || complain "cli.md lacks lapservo $*"
  expect_completed "$options" "$@" -
  while read -r option choices; do
    choices=$(sed -E 's/.*:\{([^}]*)\}.*/\1/' <<<"$choices" | tr ',' '\n' | sort)
    expect_completed "$choices" "$@" "$option" ""
    expect_completed "$choices" "$@" "$option" = ""
  done < <(grep -E '^  --[a-z-]+ [A-Z]+:\{' <<<"$help" || true)
  subcommands=$(sed -n '/^Subcommands:/,/^$/s/^  \([a-z-]*\) .*/\1/p' <<<"$help" | sort)
  [ -z "$subcommands" ] || expect_completed "$subcommands" "$@" ""
  for sub in $subcommands; do check_command "$@" "$sub"; done
}

check_command
expect_completed illumination experiment ill
expect_completed "" calibrate all --turn reg
expect_completed "" check --out ""  # a file
pages=("$reference"/man1/*.1)
[ ${#pages[@]} -eq "$count" ] || complain "${#pages[@]} pages for $count commands"
exit $failed
