#!/bin/bash
# Writes the man page of a program, by help2man, and its completions for bash, zsh and fish, by
# completions.awk, from what the program and its commands print with --help.
#
#   manual.sh SHARE PROGRAM...
#
# Files go below SHARE where `share` of an installation has them. PROGRAM may be several words, as
# in `qemu-aarch64 proofmass-worker`. Without help2man there is no man page.
set -euo pipefail

share=$1
start=("${@:2}")
name=$(basename "${start[-1]}")
stage=$(mktemp --directory)
trap 'rm -rf "$stage"' EXIT
# The commands that a help text lists: after the options, between headings in lines of their own.
commands_in() {
  sed -n '/^Options:/,/^Exit codes:/p' | sed -n '/^$/,$p' | sed -n 's/^  \([a-z-]*\) .*/\1/p'
}

# A line `@ COMMAND` before the help of each command. Texts begin in column 31; a head that ends
# just before gets a second space behind it, as others have.
"${start[@]}" --help >"$stage/program"
{
  cat "$stage/program"
  for command in $(commands_in <"$stage/program"); do
    echo "@ $command"
    "${start[@]}" "$command" --help
  done
} | sed -E '/^.{30}(\(Env|REQUIRED|[0-9])/!s/^(  [^ ].{26}) ([^ ])/\1  \2/' >"$stage/help"

for place in man/man1 bash-completion/completions zsh/site-functions fish/vendor_completions.d; do
  mkdir -p "$share/$place"
done
words_for() { awk -v shell="$1" -v program="$name" -f "${0%/*}/completions.awk" "$stage/help"; }
words_for bash >"$stage/list"
sed -e "/^LIST$/{r $stage/list" -e 'd}' -e "s/PROGRAM/$name/; s/FUNCTION/_${name//-/_}/" \
  "${0%/*}/completion.bash" >"$share/bash-completion/completions/$name"
words_for zsh >"$share/zsh/site-functions/_$name"
words_for fish >"$share/fish/vendor_completions.d/$name.fish"

rm -f "$share/man/man1/$name.1"
command -v help2man >/dev/null || {
  echo "manual: help2man is not installed: no man page of $name" >&2
  exit 0
}
# What help2man takes for sections: the commands become parts of one, below their usage, and say
# their exit codes in a line.
awk '
  NR == 1 { next }  # The purpose, which is in NAME.
  codes && !/^  [0-9]+ / { print codes; codes = "" }
  /^@ / && !is_command++ { print "*Commands*\n" }
  /^@ / { getline purpose; next }
  is_command && /^Usage: / { print "\n" substr($0, 8) ":\n    " purpose "\n"; next }
  is_command && /^(Positionals|Options):$/ { next }
  is_command && /^  -h,--help/ { next }
  /^Exit codes:$/ && is_command { codes = "    Exit status:"; next }
  /^Exit codes:$/ { print "*Exit status*\n"; next }
  is_command && /^  [0-9]+ / { codes = codes " " $1; next }
  { sub(/^  -h,/, "  -h, "); print }
  END { if (codes) print codes }
' "$stage/help" >"$stage/text"
echo '[SEE ALSO]
.BR proofmass (1), proofmass-coordinator (1), proofmass-worker (1)' >"$stage/include"
# Nothing that a reader copies may be broken into two words. Without a date, a page is reproducible.
help2man --no-info --name "$(head --lines 1 "$stage/help" | sed 's/\.$//')" \
  --version-string "$("${start[@]}" --version)" --manual Proofmass --include "$stage/include" \
  "cat '$stage/text' #" | sed -e 's/^\(\.TH .* "1" \)"[^"]*"/\1""/' \
  -e 's/^\.SH NAME$/.nh\n.ad l\n&/' >"$share/man/man1/$name.1"
