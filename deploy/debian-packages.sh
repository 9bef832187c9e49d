#!/bin/bash
# Makes the Debian packages `proofmass` and `proofmass-worker` for Debian 12. The same build at the
# same commit gives the same bytes.
#
#   debian-packages.sh [--build DIR] [--output DIR]
#
# DIR of --build is a build tree (build/release by default, built if it is not there); the packages
# go to the one of --output (the current directory by default).
set -euo pipefail

. "$(dirname "${BASH_SOURCE[0]}")/packaging.sh"

cpack --config "$build/CPackConfig.cmake" -B "$stage" >"$stage/log" || {
  cat "$stage/log" >&2
  fail "cpack failed"
}
for package in "$stage"/*.deb; do
  mv "$package" "$output/"
  echo "wrote $output/${package##*/}"
done
