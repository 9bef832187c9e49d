#!/bin/bash
# no_weak_symbols.sh NM OBJECT...: fails if an object defines a weak or unique symbol, or if there
# are fewer than five objects to look at.
set -euo pipefail

nm=$1
shift
[[ $# -ge 5 ]] || { echo "expected five kernel objects, got $#" >&2; exit 1; }
status=0
for object in "$@"; do
  weak=$("$nm" --demangle "$object" | awk '$2 ~ /^[WVu]$/')
  [[ -z $weak ]] && continue
  printf '%s\n%s\n' "$object" "$weak" >&2
  status=1
done
exit "$status"
