# Completes PROGRAM in bash.
#
# Each line of the list has a command (. for none), an option or the place of an argument, and what
# it takes: - for a flag, words a|b, a FILE, a FILE.db with this extension, a DIR, or other text.
# Bash breaks words at = and :, so that --format=csv and tcp://a:5555 are several.
FUNCTION() {
  local list current=${COMP_WORDS[COMP_CWORD]} command=. place=1 key= is_value= word of name type
  list=$(cat <<'END'
LIST
END
  )
  takes() {  # The type of what a command's option or argument takes.
    while read -r of name type; do
      [[ $of == "$1" && ($name == "$2" || $name == *+ && $2 == [0-9]* && $2 -ge ${name%+}) ]] &&
        echo "$type" && return
    done <<<"$list"
  }
  [[ $current == = ]] && current=
  for word in "${COMP_WORDS[@]:1:COMP_CWORD - 1}"; do
    if [[ $word == [=:]* ]]; then
      is_value=1
    elif [[ $is_value ]]; then
      is_value= key=
    elif [[ $word == -* ]]; then
      key=$word
      [[ $(takes $command "$word") != @(-|) ]] && is_value=1
    elif [[ $command == . && "|$(takes . 1)|" == *"|$word|"* ]]; then
      command=$word
    else
      ((++place))
    fi
  done
  COMPREPLY=()
  if [[ ! $is_value && $current == -* ]]; then
    while read -r of name type; do
      [[ $of == "$command" && $name == "$current"* && $name == -* ]] && COMPREPLY+=("$name")
    done <<<"$list"
    return
  fi
  [[ $is_value ]] || key=$place
  type=$(takes $command "$key")
  case $type in
    *'|'*) mapfile -t COMPREPLY < <(compgen -W "${type//|/ }" -- "$current") ;;
    FILE* | DIR)
      compopt -o filenames 2>/dev/null
      [[ $type == DIR ]] && type=FILE/  # No file has a name that ends in a slash.
      mapfile -t COMPREPLY < <(compgen -f -X "!*${type#FILE}" -- "$current"
        compgen -d -- "$current") ;;
  esac
}

complete -F FUNCTION PROGRAM
