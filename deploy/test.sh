#!/bin/bash
# Installs what is missing, builds, and runs the tests that a change needs; with --all also the long
# ones (label `long`: batch systems, packages, browsers, emulated processors, fault schedules).
# Further arguments go to ctest: test.sh -L unit
set -euo pipefail

root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
# Tests wait for their processes about as long as they compute.
selection=(--parallel 4)
targets=(all)
if [[ ${1:-} == --all ]]; then
  targets+=(
    unoptimised_recorded_bits_test proofmass_benchmarks proofmass_store_benchmark
    proofmass_fuzz_corpus
  )
  shift
else
  selection+=(--label-exclude '^long$')
fi

"$root/deploy/install-deps.sh"
cd "$root"
cmake --preset release
cmake --build --preset release --target "${targets[@]}"
exec ctest --preset release "${selection[@]}" "$@"
