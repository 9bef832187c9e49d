#!/bin/bash
# make-sysroot.sh DIRECTORY: unpacks Debian's arm64 packages of the libraries that core, its tests
# and the worker are built with into a directory, for deploy/arm64/toolchain.cmake. Does nothing if
# the directory has been made from the same list of packages. Needs apt on Debian 12, and neither
# root nor a change to the architectures of this machine's dpkg: apt works in a state directory of
# its own.
set -euo pipefail

packages=(
  libc6-dev libstdc++6
  libeigen3-dev libhwy-dev librandom123-dev libboost-dev
  libzmq3-dev cppzmq-dev libsodium-dev libprotobuf-dev
  libfmt-dev libspdlog-dev libcli11-dev libtomlplusplus-dev
  nlohmann-json3-dev libutfcpp-dev libgtest-dev libgmock-dev
)

if [[ $# -ne 1 ]]; then
  echo "usage: make-sysroot.sh DIRECTORY" >&2
  exit 2
fi
directory=$(realpath --canonicalize-missing "$1")
list=$directory/packages
if [[ -e $list && $(<"$list") == "${packages[*]}" ]]; then
  echo "make-sysroot: $directory is complete"
  exit 0
fi

state=$(mktemp --directory)
trap 'rm -rf "$state"' EXIT
mkdir -p "$state"/{lists,cache}/partial
touch "$state/status"
cat >"$state/apt.conf" <<CONF
APT::Architecture "arm64";
APT::Architectures { "arm64"; };
APT::Install-Recommends "false";
APT::Sandbox::User "root";
Acquire::Languages "none";
Dir::State "$state";
Dir::State::lists "$state/lists";
Dir::State::status "$state/status";
Dir::Cache "$state/cache";
Dir::Cache::archives "$state/cache";
Dir::Log "$state";
Debug::NoLocking "true";
CONF
export APT_CONFIG=$state/apt.conf

# An origin without packages for arm64 is an error to apt; what then lacks is missed below.
apt-get update --quiet --quiet || true
apt-get install --quiet --quiet --yes --download-only "${packages[@]}"

rm -rf "$directory"
mkdir -p "$directory"
for package in "$state"/cache/*.deb; do
  dpkg-deb --extract "$package" "$directory"
done
echo "${packages[*]}" >"$list"
echo "make-sysroot: $directory has $(find "$state/cache" -name '*.deb' | wc -l) packages"
