#!/bin/bash
# Installs what is missing, builds and runs all tests. Arguments go to ctest: test.sh -L unit
set -euo pipefail

root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)

"$root/deploy/install-deps.sh"
cd "$root"
cmake --preset release
cmake --build --preset release
exec ctest --preset release "$@"
