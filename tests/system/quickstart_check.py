#!/usr/bin/env python3
"""Holds that deploy/quickstart.sh installs and configures nothing that only tests need.

It runs with stand-ins for dpkg-query, apt-get and cmake that write down how they were called, in a copy
of what it reads. The presets of CMake are read as they are: `programs`, which a user gets, has neither
tests nor benchmarks, and `release` switches both on again in the same build tree.
"""

import json
import pathlib
import shutil
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parents[2]
FOR_TESTS = ("slurmctld", "chromium", "g++-aarch64-linux-gnu", "systemd-container", "libgtest-dev", "npm")
STAND_IN = '#!/bin/sh\necho "$(basename "$0") $*" >> "$CALLS"\n'


def calls_of(folder):
    """What quickstart.sh calls where no package is installed."""
    (folder / "bin").mkdir()
    for program in ("apt-get", "cmake", "sudo", "dpkg-query"):
        text = STAND_IN + ('exec "$@"\n' if program == "sudo" else "")
        (folder / "bin" / program).write_text(text)
        (folder / "bin" / program).chmod(0o755)
    shutil.copytree(ROOT / "deploy", folder / "deploy")
    programs = folder / "build/release/bin"
    programs.mkdir(parents=True)
    (programs / "proofmass").write_text(STAND_IN)
    (programs / "proofmass").chmod(0o755)
    environment = {"PATH": f"{folder}/bin:/usr/bin:/bin", "CALLS": str(folder / "calls")}
    subprocess.run([folder / "deploy/quickstart.sh"], cwd=folder, env=environment, check=True,
                   stdout=subprocess.DEVNULL)
    return (folder / "calls").read_text().splitlines()


def problems_of(calls):
    problems = []
    (install,) = [call.split() for call in calls if call.startswith("apt-get install")]
    problems += [f"{package} is installed" for package in FOR_TESTS if package in install]
    if "libzmq3-dev" not in install:
        problems.append("libzmq3-dev is not installed")
    if "cmake --preset programs" not in calls:
        problems.append(f"calls = {calls} (must have cmake --preset programs)")
    presets = json.loads((ROOT / "CMakePresets.json").read_text())
    configure = {preset["name"]: preset for preset in presets["configurePresets"]}
    for name, value in (("programs", "OFF"), ("release", "ON")):
        for what in ("TESTS", "BENCHMARKS"):
            found = configure.get(name, {}).get("cacheVariables", {}).get(f"PROOFMASS_BUILD_{what}")
            if found != value:
                problems.append(f"{name}: PROOFMASS_BUILD_{what} = {found} (must be {value})")
    return problems


def main():
    with tempfile.TemporaryDirectory(prefix="quickstart_check.") as name:
        problems = problems_of(calls_of(pathlib.Path(name)))
    print("\n".join(problems) if problems else "quickstart_check: all is well")
    return 1 if problems else 0


if __name__ == "__main__":
    sys.exit(main())
