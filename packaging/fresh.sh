#!/usr/bin/env bash
# fresh.sh RELEASE: runs README's commands (its lines ./dev ...) as a new user does: in a bare root of that Debian release, with
# nothing of this machine but what is committed. Prints how long each takes. FRESH_EXTRA: packages to install before, such as ccache.
set -euo pipefail
release=$1
cd "$(dirname "$0")/.."
[ "$(id -u)" -eq 0 ] || { echo "fresh: a root of its own needs root" >&2; exit 2; }
mirror=${LAPSERVO_MIRROR:-http://deb.debian.org/debian}
clone=$(mktemp -d)
trap 'rm -rf "$clone"' EXIT
git clone --quiet --no-local . "$clone/lapservo"
cat >"$clone/commands" <<'SCRIPT'
#!/bin/bash
# Runs the lines of README.md that begin with ./dev.
set -eo pipefail
cd "$HOME/lapservo"
mapfile -t commands < <(grep -x '\./dev [a-z]*' README.md)
[ ${#commands[@]} -eq 2 ] || { echo "README.md has ${#commands[@]} lines ./dev ..., expected 2" >&2; exit 1; }
times=()
for command in "${commands[@]}"; do
  echo "fresh: $command"
  begin=$SECONDS
  bash -c "$command" </dev/null
  times+=("$command took $(((SECONDS - begin) / 60)) min $(((SECONDS - begin) % 60)) s")
done
printf 'fresh: %s\n' "${times[@]}"
SCRIPT
chmod +x "$clone/commands"
mmdebstrap --quiet --variant=apt --dpkgopt=force-unsafe-io --format=null ${FRESH_EXTRA:+--include="$FRESH_EXTRA"} \
  --customize-hook="cp -r '$clone/lapservo' '$clone/commands' \"\$1/root\"" \
  --customize-hook='chroot "$1" env -i HOME=/root PATH="$PATH" LANG=C.UTF-8 /root/commands' \
  "$release" /dev/null "$mirror"
