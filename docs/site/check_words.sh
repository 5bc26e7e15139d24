#!/usr/bin/env bash
# check_words.sh: removed words in the pages for users: README.md, CONTRIBUTING.md, CHANGELOG.md and docs/*.md (docs/notes are records of
# their day). Code, names in backticks and targets of links are not read. docs/glossary.md has the terms to use instead.
set -euo pipefail
cd "$(dirname "$0")/../.."
words='\b(tells?|told|asks|asked|believes?|believed|doubts?|doubted|judges?|judged|suspicious|leash|pictures?|set-points?|inks? aside)\b'
words+='|\bprints? (that|which) (is|are) off\b|\bnothing was chosen\b|\beven light\b|\bgloss\b|\bno longer\b|\bhonest'
beginnings='(^|[.!?] |\| |#+ |\*\*|^ *- )(What|Of) '  # of sentences, cells and headings
found=0
for page in README.md CONTRIBUTING.md CHANGELOG.md docs/*.md; do
  text=$(awk '/^ *```/ { code = !code; print ""; next } code || /^    [^-*0-9 ]/ { print ""; next }
              { gsub(/`[^`]*`/, "`"); gsub(/\]\([^)]*\)/, "]"); print }' "$page")
  hits=$(grep -niE "$words" <<<"$text" || true; grep -nE "$beginnings" <<<"$text" || true)
  [ -z "$hits" ] || { found=1; sed "s|^|$page:|" <<<"$hits" >&2; }
done
[ "$found" -eq 0 ] || { echo "check_words: use the terms of docs/glossary.md" >&2; exit 1; }
