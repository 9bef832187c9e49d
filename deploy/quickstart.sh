#!/bin/bash
# From a fresh Debian 12 to the tables of [Hardy2013]: installs what is missing, builds, runs the
# paper's 100 draws into hardy2013.db in the current directory and prints the tables. Run again, it
# resumes. Arguments go to `proofmass run`: quickstart.sh --runs 1000
set -euo pipefail

root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)

"$root/deploy/install-deps.sh" --build
(
  cd "$root"
  # A build tree that is there may have the tests, which would be removed.
  [[ -f build/release/build.ninja ]] || cmake --preset programs
  cmake --build --preset programs
)
exec "$root/build/release/bin/proofmass" run "$root/deploy/campaigns/hardy2013.toml" \
  --db hardy2013.db "$@"
