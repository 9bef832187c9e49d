#!/bin/bash
# Checks the programs of a build on a machine with NVIDIA cards, in some four minutes, and prints
# what it found: `gpu_check.sh PROGRAMS`. Exits with 1 if a result differs.
set -euo pipefail

programs=$(cd "$1" && pwd)
here=$(cd "$(dirname "$0")" && pwd)
directory=$(mktemp -d)
trap 'rm -rf "$directory"' EXIT
cp "$here/../../deploy/campaigns/hardy2013.toml" "$directory"
cd "$directory"
PATH=$programs:$PATH
failures=0

run() {  # run NAME ARGUMENTS...: computes a campaign and prints its time.
  local name=$1 begin end
  shift
  begin=$(date +%s.%N)
  timeout 100 proofmass run hardy2013.toml --db "$name.db" --quiet "$@" >/dev/null
  end=$(date +%s.%N)
  local num_runs
  num_runs=$(python3 -c "
import sqlite3
database = sqlite3.connect('file:$name.db?mode=ro', uri=True)
print(database.execute('SELECT count(*) FROM run_result').fetchone()[0])")
  awk -v n="$num_runs" -v b="$begin" -v e="$end" -v name="$name" \
    'BEGIN { printf "%-28s %7d runs %8.2f s %8.1f runs/s\n", name, n, e - b, n / (e - b) }'
}

same() {  # same A B FIRST END: whether the runs of two databases are the same, to the bit.
  python3 - "$@" <<'PYTHON' || failures=$((failures + 1))
import sqlite3, sys
a, b, first, end = sys.argv[1], sys.argv[2], int(sys.argv[3]), int(sys.argv[4])
rows = [list(sqlite3.connect(f"file:{name}.db?mode=ro", uri=True).execute(
    "SELECT * FROM run_result WHERE run_index >= ? AND run_index < ? ORDER BY run_index",
    (first, end)))
    for name in (a, b)]
different = sum(x != y for x, y in zip(*rows)) + abs(len(rows[0]) - len(rows[1]))
print(f"  {a} and {b}, runs {first} to {end - 1}: {len(rows[0])} compared, {different} differ")
sys.exit(different != 0 or len(rows[0]) != end - first)
PYTHON
}

nvidia-smi --query-gpu=name,driver_version --format=csv,noheader
nproc | sed 's/$/ processors/'
card=(--gpu all --workers 1)
run card-1000 --runs 1000 "${card[@]}"
run processors-1000 --runs 1000 --range 744:1000
same card-1000 processors-1000 744 1000
run card-and-processors-100 --runs 100 --gpu all
same card-and-processors-100 card-1000 0 100
run card-40000 --runs 40000 "${card[@]}"
run processors-last --runs 40000 --range 39872:40000
same card-40000 processors-last 39872 40000
run card-and-processors --runs 5000 --gpu all
same card-and-processors card-40000 0 5000
flight=(--runs 512 --seed 7 --set 'noise.preset="flight_suref"')
run card-flight-noise "${flight[@]}" "${card[@]}"
run processors-flight-noise "${flight[@]}" --range 384:512
same card-flight-noise processors-flight-noise 384 512
(proofmass run hardy2013.toml --db stopped.db --quiet --runs 20000 "${card[@]}" \
  >/dev/null 2>stopped.log || true) &
sleep 9
pkill -TERM -f 'proofmass run hardy2013.toml --db stopped.db' || true
wait
tail -1 stopped.log
run stopped --runs 20000 "${card[@]}"
same stopped card-40000 0 20000
run card-10000 --runs 10000 "${card[@]}"
run card-100000 --runs 100000 "${card[@]}"
proofmass-card-variants 20000 || failures=$((failures + 1))
[ "$failures" = 0 ] && echo "no run differs" || echo "$failures comparisons failed"
[ "$failures" = 0 ]
