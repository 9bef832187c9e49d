# Sourced by package.sh and debian-packages.sh. Reads their options and sets `root` (of the clone),
# `build` (a build tree, made if it is the default one and not there), `output`, `stage` (a
# temporary directory) and SOURCE_DATE_EPOCH (the time of the commit, so that the same commit gives
# the same bytes).

root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
build=$root/build/release
output=$PWD

fail() {
  echo "$(basename "$0" .sh): error: $1" >&2
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
  (cd "$root" && cmake --preset programs && cmake --build --preset programs)
fi
for program in proofmass proofmass-coordinator proofmass-worker; do
  [[ -x $build/bin/$program ]] || fail "--build = $build (lacks bin/$program)"
  [[ -s $build/share/man/man1/$program.1 ]] ||
    fail "--build = $build (lacks the man page of $program: install help2man and build it again)"
done

stage=$(mktemp --directory)
trap 'rm -rf "$stage"' EXIT
SOURCE_DATE_EPOCH=${SOURCE_DATE_EPOCH:-$(git -C "$root" log -1 --format=%ct 2>/dev/null || echo 0)}
export SOURCE_DATE_EPOCH
