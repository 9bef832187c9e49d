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

. "$(dirname "${BASH_SOURCE[0]}")/packaging.sh"

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
# Programs look for each other beside the program that runs, which is the loader.
ln -s ../bin/proofmass ../bin/proofmass-worker "$tree/lib/"

tar --directory "$stage" --create --sort=name --mtime="@$SOURCE_DATE_EPOCH" \
  --owner=0 --group=0 --numeric-owner --mode=u=rwX,go=rX "$name" |
  gzip --no-name >"$stage/$name.tar.gz"
mv "$stage/$name.tar.gz" "$output/"
echo "wrote $output/$name.tar.gz"
