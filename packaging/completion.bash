# Subcommands, options and the words that these take, as the --help of the command under the cursor has them; else files.
_lapservo() {
  local current=${COMP_WORDS[COMP_CWORD]} previous=${COMP_WORDS[COMP_CWORD - 1]} command=("${COMP_WORDS[0]}") help subcommands option words word
  for word in "${COMP_WORDS[@]:1:COMP_CWORD-1}" --; do
    help=$("${command[@]}" --help 2>/dev/null)
    subcommands=$(sed -n '/^Subcommands:/,/^$/s/^  \([a-z-]*\) .*/\1/p' <<<"$help")
    grep -qxF -e "$word" <<<"$subcommands" || break
    command+=("$word")
  done
  [[ $current == = ]] && current=
  [[ $previous == = ]] && previous=${COMP_WORDS[COMP_CWORD - 2]}
  option=$(grep -F -e "  $previous " <<<"$help" | grep -E '^  --[a-z-]+ [A-Z]+')
  if [[ $option ]]; then
    words=$(sed -nE 's/^[^{]*:\{([^}]*)\}.*/\1/p' <<<"$option" | tr , ' ')
  elif [[ $current == -* ]]; then
    words=$(grep -oE '^  (-[a-z],)?--[a-z-]+' <<<"$help" | tr , ' ')
  else
    words="$subcommands $(sed -nE 's/^  [a-z]+ [A-Z]+:\{([^}]*)\}.*/\1/p' <<<"$help" | tr , ' ')"
  fi
  mapfile -t COMPREPLY < <(compgen -W "$words" -- "$current")
}
complete -o default -F _lapservo lapservo
