# Writes a completion script of a program from the help texts of it and its commands; a line
# `@ COMMAND` comes before each but the first. Set `program`, and `shell` to bash, zsh or fish; for
# bash it writes the list that completion.bash reads.
#
# A line of a help text is `  -h,--help TYPE ...   TEXT`. The type tells what a value is: one of the
# words of `a|b`, a FILE, a FILE.db with that extension, a directory DIR, or else nothing that can
# be offered.

/^@ / { command = $2; part = ""; next }
/^Exit codes:/ { part = "codes"; next }
/^[A-Z].*:$/ { part = $0; next }
/^                    / {
  if (part != "codes") text[count] = text[count] (text[count] == "" ? "" : " ") trimmed($0)
  next
}
/^  [^ ]/ && part != "codes" && part != "" { add(part) }

function trimmed(line) { gsub(/^ +| +$/, "", line); return line }

function add(part,   end, head, words) {
  ++count
  of[count] = command
  end = match(substr($0, 3), /  +/)
  head = end ? substr($0, 3, end - 1) : trimmed($0)
  text[count] = end ? trimmed(substr($0, end + 3)) : ""
  split(head, words, " ")
  names[count] = words[1]
  type[count] = words[2] ~ /^\(/ ? "" : words[2]
  sub(/:\[.*/, "", type[count])  # A range.
  is_repeated[count] = head ~ / \.\.\./
  is_required[count] = head ~ / REQUIRED/
  if (part == "Positionals:") place[count] = ++num_places[command]
  else if (part != "Options:") { is_command[count] = 1; ++num_commands }
}

function quoted(word) { gsub(/'/, "'\\''", word); return "'" word "'" }
function escaped(word, special,   i, c, result) {
  for (i = 1; i <= length(word); ++i) {
    c = substr(word, i, 1)
    result = result (index(special, c) ? "\\" : "") c
  }
  return result
}
function extension(i) { return type[i] ~ /^FILE/ ? substr(type[i], 5) : "" }
function words_of(i,   words) { words = type[i]; return gsub(/[|]/, " ", words) ? words : "" }

# The command, an option or the place of an argument, and what it takes: a type, or - for a flag.
function write_bash(   i, j, n, name, list) {
  for (i = 1; i <= count; ++i) {
    if (is_command[i]) { list = list (list == "" ? "" : "|") names[i]; continue }
    n = split(place[i] ? place[i] : names[i], name, ",")
    for (j = 1; j <= n; ++j)
      print (of[i] == "" ? "." : of[i]), name[j] (place[i] && is_repeated[i] ? "+" : ""),
            type[i] == "" ? "-" : type[i]
  }
  if (list != "") print ". 1 " list
}

function zsh_action(i) {
  if (words_of(i) != "") return "(" words_of(i) ")"
  if (extension(i) != "") return "_files -g \"*" extension(i) "\""
  return type[i] == "FILE" ? "_files" : type[i] == "DIR" ? "_files -/" : " "
}
function zsh_specifications(wanted,   i, j, n, name, all, one) {
  for (i = 1; i <= count; ++i) {
    if (of[i] != wanted || is_command[i]) continue
    n = split(names[i], name, ",")
    for (j = 1; j <= n; ++j) {
      if (place[i])
        one = (is_repeated[i] ? "*" : place[i]) (is_required[i] ? ":" : "::") \
              escaped(name[j], "\\:") ":" zsh_action(i)
      else
        one = (is_repeated[i] ? "*" : "") name[j] \
              (type[i] == "" ? "" : name[j] ~ /^--/ ? "=" : "+") \
              "[" escaped(text[i], "\\[]") "]" \
              (type[i] == "" ? "" : ":" escaped(type[i], "\\:") ":" zsh_action(i))
      all = all " \\\n    " quoted(one)
    }
  }
  return all
}
function write_zsh(   i) {
  print "#compdef " program
  print "local curcontext=$curcontext state line\ntypeset -A opt_args"
  if (num_commands) print "local -a commands=("
  for (i = 1; i <= count; ++i)
    if (is_command[i]) print "  " quoted(names[i] ":" escaped(text[i], "\\:"))
  if (num_commands) print ")"
  print "_arguments -C" zsh_specifications("") \
        (num_commands ? " \\\n    '1:command:->command' '*::argument:->arguments'" : "")
  if (!num_commands) return
  print "case $state in\n  command) _describe command commands ;;\n  arguments) case $words[1] in"
  for (i = 1; i <= count; ++i)
    if (is_command[i]) print "  " names[i] ") _arguments" zsh_specifications(names[i]) " ;;"
  print "  esac ;;\nesac"
}

function fish_offer(i) {
  if (words_of(i) != "") return " -x -a " quoted(words_of(i))
  if (extension(i) != "") return " -r -k -a '(__fish_complete_suffix " extension(i) ")'"
  if (type[i] == "DIR") return " -x -a '(__fish_complete_directories)'"
  return type[i] == "FILE" ? " -r -F" : type[i] == "" ? "" : " -x"
}
function write_fish(   i, j, n, name, begin, options) {
  for (i = 1; i <= count; ++i) {
    begin = "complete -c " program
    if (of[i] != "") begin = begin " -n '__fish_seen_subcommand_from " of[i] "'"
    else if (num_commands) begin = begin " -n __fish_use_subcommand"
    # Files are offered only where an argument is a file of any name.
    if (type[i] == "FILE" && place[i]) is_silent[begin] = 1
    if (!is_silent[begin]++) print begin " -f"
    if (is_command[i]) { print begin " -a " names[i] " -d " fish_quoted(text[i]); continue }
    if (place[i] && words_of(i) extension(i) != "") print begin substr(fish_offer(i), 4)
    if (place[i]) continue
    n = split(names[i], name, ",")
    options = ""
    for (j = 1; j <= n; ++j)
      options = options (name[j] ~ /^--/ ? " -l " substr(name[j], 3) : " -s " substr(name[j], 2))
    print begin options fish_offer(i) " -d " fish_quoted(text[i])
  }
}
function fish_quoted(word) { return "'" escaped(word, "\\'") "'" }

END {
  if (shell == "bash") write_bash()
  else if (shell == "zsh") write_zsh()
  else write_fish()
}
