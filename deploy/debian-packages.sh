#!/bin/bash
# Makes the Debian packages `proofmass` and `proofmass-worker` for Debian 12. The same build at the
# same commit gives the same bytes.
#
#   debian-packages.sh [--build DIR] [--output DIR]
#
# DIR of --build is a build tree (build/release by default, built if it is not there); the packages
# go to the one of --output (the current directory by default).
set -euo pipefail

root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
build=$root/build/release
output=$PWD

fail() {
  echo "debian-packages: error: $1" >&2
  exit "${2:-1}"
}

while [[ $# -gt 0 ]]; do
  [[ $# -gt 1 ]] || fail "$1 needs a directory" 2
  case $1 in
    --build) build=$2 ;;
    --output) output=$2 ;;
    *) fail "option = $1 (must be --build or --output)" 2 ;;
  esac
  shift 2
done
[[ -d $output ]] || fail "--output = $output (must be a directory)" 2

if [[ ! -d $build ]]; then
  [[ $build == "$root/build/release" ]] || fail "--build = $build (must be a build tree)" 2
  (cd "$root" && cmake --preset release && cmake --build --preset programs)
fi
for program in proofmass proofmass-coordinator proofmass-worker; do
  [[ -x $build/bin/$program ]] || fail "--build = $build (lacks bin/$program)"
done

stage=$(mktemp --directory)
trap 'rm -rf "$stage"' EXIT
date=$(git -C "$root" log -1 --format=%ct 2>/dev/null || echo 0)
export SOURCE_DATE_EPOCH=${SOURCE_DATE_EPOCH:-$date}
cpack --config "$build/CPackConfig.cmake" -B "$stage" >"$stage/log" || {
  cat "$stage/log" >&2
  fail "cpack failed"
}
for package in "$stage"/*.deb; do
  mv "$package" "$output/"
  echo "wrote $output/${package##*/}"
done
