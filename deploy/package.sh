#!/bin/bash
# Makes a tarball of the programs with the loader and all libraries that they need: it runs on other
# Linux systems (x86-64), from any directory and without root, also where the system's C library is
# older than that of Debian 12. The same build at the same commit gives the same bytes.
#
#   package.sh [--build DIR] [--output DIR]
#
# DIR of --build is a build tree (build/release by default, built if it is not there); the tarball
# goes to the one of --output (the current directory by default).
set -euo pipefail

root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
build=$root/build/release
output=$PWD

fail() {
  echo "package: error: $1" >&2
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
version=$("$build/bin/proofmass" --version | cut -d' ' -f2)
name=proofmass-$version-linux-x86_64
tree=$stage/$name

# Programs, campaigns and documents as they are installed, but for the SQLite extension: it would
# have to fit the SQLite of the system.
cmake --install "$build" --prefix "$tree" --strip >/dev/null
rm -rf "$tree/lib"
mkdir -p "$tree/lib"
mv "$tree/bin" "$tree/libexec"

# Each library under the name by which it is looked for, and the loader, and the terms of each.
mapfile -t libraries < <(ldd "$tree"/libexec/* |
  sed -n 's/.*=> \(\/[^ ]*\).*/\1/p; s/^\s*\(\/[^ ]*ld-linux[^ ]*\).*/\1/p' | sort --unique)
mapfile -t files < <(realpath "${libraries[@]}")
# dpkg knows some files by their names below /lib, which is a link to /usr/lib.
owners=$(dpkg-query --search "${files[@]}" "${files[@]#/usr}" 2>/dev/null || true)
mkdir -p "$tree/share/doc/libraries"
for i in "${!libraries[@]}"; do
  cp --dereference "${libraries[i]}" "$tree/lib/"
  package=$(grep --max-count=1 "/${files[i]##*/}\$" <<<"$owners" | cut -d: -f1)
  [[ -n $package && -r /usr/share/doc/$package/copyright ]] ||
    fail "${libraries[i]} (is of no Debian package whose terms are known)"
  cp "/usr/share/doc/$package/copyright" "$tree/share/doc/libraries/$package"
done

mkdir -p "$tree/bin"
cat >"$tree/bin/proofmass" <<'START'
#!/bin/sh
# Starts the program of this file's name with the loader and the libraries beside it. What a site
# preloads into its programs is meant for its own C library.
unset LD_PRELOAD
home=$(dirname "$(dirname "$(readlink -f "$0")")")
exec "$home/lib/ld-linux-x86-64.so.2" --inhibit-cache --library-path "$home/lib" \
  "$home/libexec/$(basename "$0")" "$@"
START
chmod 755 "$tree/bin/proofmass"
ln -s proofmass "$tree/bin/proofmass-coordinator"
ln -s proofmass "$tree/bin/proofmass-worker"
# `proofmass run` looks for the worker beside the program that runs, which is the loader.
ln -s ../bin/proofmass-worker "$tree/lib/proofmass-worker"

date=$(git -C "$root" log -1 --format=%ct 2>/dev/null || echo 0)
tar --directory "$stage" --create --sort=name --mtime="@${SOURCE_DATE_EPOCH:-$date}" \
  --owner=0 --group=0 --numeric-owner --mode=u=rwX,go=rX "$name" |
  gzip --no-name >"$stage/$name.tar.gz"
mv "$stage/$name.tar.gz" "$output/"
echo "wrote $output/$name.tar.gz"
