#!/bin/bash
# Makes the Debian packages `proofmass` and `proofmass-worker` for Debian 12. The same build at the
# same commit gives the same bytes. Their version has the time of the commit, so that those of a
# newer one replace them.
#
#   debian-packages.sh [--build DIR] [--output DIR]
#
# DIR of --build is a build tree (build/release by default, built if it is not there); the packages
# go to the one of --output (the current directory by default).
set -euo pipefail

. "$(dirname "${BASH_SOURCE[0]}")/packaging.sh"

version=$("$build/bin/proofmass" --version | cut -d' ' -f2)
version+=+$(date --utc --date="@$SOURCE_DATE_EPOCH" +%Y%m%d.%H%M%S)
commit=$(git -C "$root" rev-parse --short=8 HEAD 2>/dev/null) && version+=.g$commit
cpack --config "$build/CPackConfig.cmake" -B "$stage" -D "CPACK_DEBIAN_PACKAGE_VERSION=$version" \
  -D "CPACK_DEBIAN_PROOFMASS_PACKAGE_DEPENDS=proofmass-worker (= $version)" >"$stage/log" || {
  cat "$stage/log" >&2
  fail "cpack failed"
}
for package in "$stage"/*.deb; do
  mv "$package" "$output/"
  echo "wrote $output/${package##*/}"
done
