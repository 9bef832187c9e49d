#!/bin/bash
# Installs the Debian 12 packages that Proofmass is built, run and tested with; with --build, only
# those that it is built and run with; with --all, also those for fuzzing, for benchmarks beside
# other systems and for container images. Does nothing if all are there. Uses sudo unless run as
# root.
set -euo pipefail

packages=(
  g++ clang cmake ninja-build pkg-config git
  libeigen3-dev libhwy-dev librandom123-dev
  libzmq3-dev cppzmq-dev libsodium-dev libprotobuf-dev protobuf-compiler
  libsqlite3-dev sqlite3 libhdf5-dev
  libspdlog-dev libfmt-dev libcli11-dev libtomlplusplus-dev nlohmann-json3-dev
  libutfcpp-dev libboost-dev help2man
)
test_packages=(
  libgtest-dev libgmock-dev libbenchmark-dev qemu-user g++-aarch64-linux-gnu clang-format
  iproute2 iptables faketime python3-scipy python3-mpmath python3-h5py
  python3-numpy python3-pandas python3-matplotlib
  sshfs openssh-sftp-server busybox-static
  slurmctld slurmd slurm-client slurm-wlm-basic-plugins munge
  groff-base zsh fish librsvg2-bin
  chromium nodejs prometheus
  systemd systemd-container mmdebstrap dpkg-dev python3-yaml python3-distributed
)
# Node.js of other origin brings npm and excludes Debian's package of that name.
command -v npm >/dev/null || test_packages+=(npm)
# The fuzzer, the systems that the dispatch is measured beside, and what builds images.
more_packages=(libclang-rt-14-dev parallel python3-ipyparallel buildah)

case "${1:-}" in
  '') packages+=("${test_packages[@]}") ;;
  --build) ;;
  --all) packages+=("${test_packages[@]}" "${more_packages[@]}") ;;
  *)
    echo "install-deps: error: argument = $1 (must be --build, --all or none)" >&2
    exit 2
    ;;
esac

is_installed() {
  [[ $(dpkg-query --show --showformat='${db:Status-Status}' "$1" 2>/dev/null) == installed ]]
}

missing=()
for package in "${packages[@]}"; do
  is_installed "$package" || missing+=("$package")
done

if [[ ${#missing[@]} -eq 0 ]]; then
  echo "install-deps: all ${#packages[@]} packages are installed"
  exit 0
fi

as_root=()
if [[ $(id --user) -ne 0 ]]; then
  command -v sudo >/dev/null || {
    echo "install-deps: needs root or sudo to install: ${missing[*]}" >&2
    exit 1
  }
  as_root=(sudo)
fi

echo "install-deps: installing ${missing[*]}"
"${as_root[@]}" apt-get update --quiet
"${as_root[@]}" env DEBIAN_FRONTEND=noninteractive \
  apt-get install --quiet --yes --no-install-recommends "${missing[@]}"
