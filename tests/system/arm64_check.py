#!/usr/bin/env python3
"""Builds core and the worker for ARM64 and runs both on an emulated processor:

- core has the recorded bits of x86-64;
- a campaign that a worker of this machine and an emulated ARM64 worker compute has the digest of
  `proofmass run` on this machine.

Needs Debian's g++-aarch64-linux-gnu and qemu-user, and a mirror for the libraries. Exit code 0 if
all holds, 1 if not; 77 if it cannot run, but 1 if the environment has CI.
"""

import json
import os
import shutil
import sqlite3
import subprocess
import tempfile
import time
from pathlib import Path

import checking
from checking import SOURCE, check, skip

NEEDED = ("aarch64-linux-gnu-g++", "qemu-aarch64")
NUM_RUNS = 48
# Left out, because the emulated processor takes longest for them. The reference digest passes
# through the kernel of batches, and the worker computes it when it starts.
LEFT_OUT = "Batch.*:ReferenceDigest.*"
PATIENCE_S = 300
MACHINE_ARM64 = 183  # EM_AARCH64, in the header of a program.


class Stopwatch:
    """Says how long each part took, and how much processor time of the programs that it started."""

    def __init__(self):
        self.start = self.times()

    @staticmethod
    def times():
        times = os.times()
        return times.elapsed, times.children_user + times.children_system

    def lap(self, what):
        now = self.times()
        wall_s, processor_s = (after - before for before, after in zip(self.start, now))
        print(f"{wall_s:6.1f} s, {processor_s:6.1f} s of processor time: {what}", flush=True)
        self.start = now


def configure(directory, sysroot):
    command = ["cmake", "--preset", "arm64", "-B", directory, f"-DPROOFMASS_SYSROOT={sysroot}"]
    subprocess.run(command, cwd=SOURCE, stdout=subprocess.DEVNULL, check=True)


def build(directory, target):
    subprocess.run(["cmake", "--build", directory, "--parallel", "1", "--target", target],
                   stdout=subprocess.DEVNULL, check=True)


def check_is_for_arm64(program):
    header = program.read_bytes()[:20]
    machine = int.from_bytes(header[18:20], "little")
    check(machine == MACHINE_ARM64, f"machine = {machine} (must be {MACHINE_ARM64}): {program}")


def check_recorded_bits(emulator, program):
    check_is_for_arm64(program)
    subprocess.run([*emulator, program, "--gtest_brief=1", f"--gtest_filter=-{LEFT_OUT}"], check=True)


class Campaign:
    """A short campaign in a directory, and what serves it."""

    def __init__(self, programs, directory):
        self.programs = programs
        self.directory = directory
        self.endpoint = f"ipc://{directory}/workers"
        self.processes = {}
        checking.write_short_campaign(programs, directory, NUM_RUNS)

    def command(self, program, *words):
        return subprocess.run([self.programs / program, *words], cwd=self.directory, check=True,
                              stdout=subprocess.PIPE, text=True).stdout

    def start(self, name, *words):
        with open(self.directory / f"{name}.log", "wb") as log:
            self.processes[name] = subprocess.Popen(words, cwd=self.directory, stdout=log,
                                                    stderr=log)

    def start_worker(self, name, *program):
        self.start(name, *program, "--connect", self.endpoint, "--name", name, "--threads", "1")

    def num_runs_of(self, worker):
        database = self.directory / "served/hardy2013.db"
        if not database.exists():
            return 0
        with sqlite3.connect(f"file:{database}?mode=ro", uri=True) as connection:
            return connection.execute("SELECT count(*) FROM run WHERE worker = ?",
                                      (worker,)).fetchone()[0]

    def wait_for_runs_of(self, worker):
        end = time.monotonic() + PATIENCE_S
        while self.num_runs_of(worker) == 0:
            check(time.monotonic() < end, f"{worker} delivered nothing in {PATIENCE_S} s")
            check(self.processes[worker].poll() is None, f"{worker} ended")
            time.sleep(0.2)

    def digest(self, file):
        return json.loads(self.command("proofmass", "report", file, "--json"))["digest"]

    def close(self):
        for process in self.processes.values():
            process.kill()
            process.wait()


def check_campaign(campaign, arm64_worker):
    """The emulated worker is much slower than the other one, which would compute its runs as well:
    the fast one comes when the slow one has delivered."""
    campaign.start("coordinator", campaign.programs / "proofmass-coordinator", "--directory",
                   "served", "--bind", campaign.endpoint, "--exit-when-done", "short.toml")
    campaign.start_worker("arm64", *arm64_worker)
    campaign.wait_for_runs_of("arm64")
    campaign.start_worker("native", campaign.programs / "proofmass-worker")
    for name, process in campaign.processes.items():
        code = process.wait(PATIENCE_S)
        check(code == 0, f"exit code = {code} (must be 0) of {name}")
    num_runs = {worker: campaign.num_runs_of(worker) for worker in ("arm64", "native")}
    print(f"runs = {num_runs}")
    check(all(num_runs.values()), "both workers must have computed runs")
    check(sum(num_runs.values()) == NUM_RUNS, "both workers must have computed all runs")

    campaign.command("proofmass", "run", "short.toml", "--db", "alone.db", "--quiet")
    digests = [campaign.digest(file) for file in ("served/hardy2013.db", "alone.db")]
    print("digests = {}, {}".format(*digests))
    check(digests[0] == digests[1], "the digest must be that of this machine alone")


def main():
    parser = checking.parser_of(__doc__)
    parser.add_argument("--build", required=True, type=Path, help="directory to build in")
    arguments = parser.parse_args()
    programs, directory = arguments.programs.resolve(), arguments.build.resolve()
    for program in NEEDED:
        if shutil.which(program) is None:
            skip(f"no {program} (deploy/install-deps.sh installs it)")
    sysroot = directory / "sysroot"
    stopwatch = Stopwatch()
    made = subprocess.run([SOURCE / "deploy/arm64/make-sysroot.sh", sysroot], check=False)
    if made.returncode != 0:
        skip("no libraries for ARM64 (deploy/arm64/make-sysroot.sh gets them from a mirror)")
    stopwatch.lap("made the root directory with the libraries")
    emulator = ["qemu-aarch64", "-L", sysroot]

    tree = directory / "build"
    configure(tree, sysroot)
    build(tree, "recorded_bits_test")
    stopwatch.lap("built recorded_bits_test")
    check_recorded_bits(emulator, tree / "tests/recorded_bits_test")
    stopwatch.lap("ran recorded_bits_test")
    build(tree, "proofmass-worker")
    worker = tree / "bin/proofmass-worker"
    check_is_for_arm64(worker)
    stopwatch.lap("built proofmass-worker")
    with tempfile.TemporaryDirectory(prefix="arm64_check.") as name:
        campaign = Campaign(programs, Path(name))
        try:
            with checking.failure_told(lambda: Path(name).glob("*.log")):
                check_campaign(campaign, [*emulator, worker])
        finally:
            campaign.close()
    stopwatch.lap("computed a campaign on both processors")


if __name__ == "__main__":
    main()
