#!/usr/bin/env bash
# reference.sh TOOL OUT: the manual pages (OUT/man1) and the page of the documentation (OUT/cli.md), from the --help of TOOL and of
# each of its subcommands.
set -euo pipefail
tool=$1 out=$2
page_of=$(dirname "$0")/manual_page.awk
mkdir -p "$out/man1"
version=$("$tool" --version)

# write COMMAND...: its page and section, then those of its subcommands.
write() {
  local help name subcommand
  help=$("$tool" "$@" --help)
  name=$(IFS=-; echo "lapservo${*:+-$*}")
  awk -v name="$name" -v version="$version" -f "$page_of" <<<"$help" >"$out/man1/$name.1"
  printf '\n## lapservo%s\n\n```text\n%s\n```\n' "${*:+ $*}" "$help" >>"$out/cli.md"
  for subcommand in $(sed -n '/^Subcommands:/,/^$/s/^  \([a-z-]*\) .*/\1/p' <<<"$help"); do write "$@" "$subcommand"; done
}

printf '# The command line\n\nThe `--help` of each command.\n' >"$out/cli.md"
write
