#!/usr/bin/env python3
"""Fails each system call on a campaign database once, or from then on, and looks at what is left.

    tests/system/system_call_sweep.py --programs build/release/bin --jobs 4
    tests/system/system_call_sweep.py --programs build/release/bin --sample 60 --seed 7

A small campaign, whose runs cost nothing, is made, resumed, extended, finished, backed up
and read. For each of these phases, each kind of call and each n, the n-th call fails (faulty_calls.cpp).
A program that still lives after 3 s is given back what it lacks. In the end:

- no program has aborted or hangs; one that refuses says `field = value (rule)`;
- what was stored before is stored after;
- exit code 0 means that the file is whole;
- the same command, undisturbed, leads to the digest of a campaign that nothing happened to.

Exit code 1 if a point failed; each is printed with the options that repeat it.
"""

import argparse
import concurrent.futures
import errno
import os
import pathlib
import random
import re
import shutil
import signal
import sqlite3
import subprocess
import sys
import tempfile
import time
import traceback

from fault_world import ABORT_MARKS, CALLS, Failure, Orders, verified_digest

NUM_RUNS = 96
NUM_RUNS_EXTENDED = 160
HEAL_AFTER_S = 3.0
END_MAX_S = 60.0
NEVER = 0xFFFFFFFF
ERRORS = {"open": ["EIO", "ENOSPC", "EMFILE"], "write": ["EIO", "ENOSPC"], "sync": ["EIO", "ENOSPC"],
          "rename": ["EIO", "ENOSPC"], "truncate": ["EIO", "ENOSPC"],
          "map": ["EIO", "ENOSPC", "EMFILE"], "link": ["EIO", "ENOSPC"], "unlink": ["EIO"]}
# As a last line, or in the log of a coordinator that could not store something and ends with that.
REFUSAL = re.compile(r"(?m)^proofmass(-coordinator)?: error: .+ (=|:) .+"
                     r"|\[error\] \w+ .*reason=\".+ = .+ \(.+\)")
LOCAL, SERVED = "proofmass", "proofmass-coordinator"

# Phase: program, state of the directory before, number of runs wanted, arguments.
PHASES = {
    "start": (SERVED, None, NUM_RUNS, []),
    "run": (LOCAL, None, NUM_RUNS, ["run", "{toml}", "--db", "{db}", "--quiet", "--workers", "1"]),
    "resume": (LOCAL, "killed", NUM_RUNS,
               ["run", "{toml}", "--db", "{db}", "--quiet", "--workers", "1"]),
    "extend": (LOCAL, "finished", NUM_RUNS_EXTENDED,
               ["run", "{toml}", "--db", "{db}", "--quiet", "--workers", "1"]),
    "finish": (SERVED, "killed", NUM_RUNS, []),
    "grow": (SERVED, "finished", NUM_RUNS_EXTENDED, []),
    "backup": (LOCAL, "finished", NUM_RUNS, ["backup", "{db}", "{copy}"]),
    "backup_killed": (LOCAL, "killed", NUM_RUNS, ["backup", "{db}", "{copy}"]),
    "report": (LOCAL, "killed", NUM_RUNS, ["report", "{db}"]),
    "export": (LOCAL, "finished", NUM_RUNS,
               ["export", "{db}", "--output", "{copy}"]),
}


class Bench:
    """Programs, definitions and prepared states."""

    def __init__(self, options, folder):
        self.folder = folder
        self.faulty_calls = options.faulty_calls
        self.programs = folder / "bin"
        self.programs.mkdir()
        for name in ("proofmass", SERVED, f"{SERVED}-with-faults"):
            shutil.copy(options.programs / name, self.programs)
        # `proofmass run` starts the worker that lies beside it.
        shutil.copy(options.programs / "proofmass-null-worker", self.programs / "proofmass-worker")
        subprocess.run([self.programs / "proofmass", "init", "paper.toml"], cwd=folder, check=True,
                       stdout=subprocess.DEVNULL)
        text = (folder / "paper.toml").read_text()
        for num_runs in (NUM_RUNS, NUM_RUNS_EXTENDED):
            short = re.sub(r"(?m)^name = .*", 'name = "small"', text, count=1)
            short = re.sub(r"(?m)^runs = .*", f"runs = {num_runs}", short, count=1)
            short = re.sub(r"(?m)^orbits = .*", "orbits = 1", short, count=1)
            (folder / f"small-{num_runs}.toml").write_text(short)
        self.digests = {}
        for num_runs in (NUM_RUNS, NUM_RUNS_EXTENDED):
            file = self.state(f"whole-{num_runs}") / "small.db"
            subprocess.run([self.programs / "proofmass", "run", self.definition(num_runs), "--db",
                            file, "--quiet"], check=True, stdout=subprocess.DEVNULL)
            self.digests[num_runs] = verified_digest(self.programs, file, is_null=True)
        shutil.copytree(folder / f"state-whole-{NUM_RUNS}", folder / "state-finished")
        self.make_killed()

    def state(self, name):
        folder = self.folder / f"state-{name}"
        folder.mkdir(exist_ok=True)
        return folder

    def definition(self, num_runs):
        return self.folder / f"small-{num_runs}.toml"

    def make_killed(self):
        """A campaign half done, whose coordinator was killed: the log is still there."""
        folder = self.state("killed")
        endpoint = f"ipc://{self.folder}/killed"
        with subprocess.Popen(
                [self.programs / f"{SERVED}-with-faults", self.definition(NUM_RUNS), "--directory", folder, "--bind",
                 endpoint, "--faults", "kill=after_commit:2"], stderr=subprocess.DEVNULL) as served:
            with subprocess.Popen(
                    [self.programs / "proofmass-worker", "--connect", endpoint, "--threads", "1",
                     "--run-time", "0.1", "--no-supervisor"], stderr=subprocess.DEVNULL) as worker:
                served.wait(END_MAX_S)
                worker.kill()
        if not 0 < len(rows_of(folder / "small.db", is_copied=True)) < NUM_RUNS:
            raise RuntimeError("the campaign was not killed half-way")


def rows_of(file, is_copied=False):
    """The runs of a file, read from a copy so that nothing changes."""
    if not file.exists():
        return set()
    with tempfile.TemporaryDirectory(dir=file.parent.parent) as folder:
        for suffix in ("", "-wal"):
            if (source := file.with_name(file.name + suffix)).exists():
                shutil.copy(source, folder)
        connection = sqlite3.connect(pathlib.Path(folder) / file.name)
        try:
            return {run for run, in connection.execute("SELECT run_index FROM run_result")}
        finally:
            connection.close()


class Point:
    """One call that fails in one phase."""

    def __init__(self, phase, call, error, number, lasts):
        self.phase, self.call, self.error = phase, call, error
        self.number, self.lasts = number, lasts

    def __str__(self):
        return f"{self.phase}:{self.call}:{self.error}:{self.number}:{'on' if self.lasts else 'once'}"


class Attempt:
    """A phase carried out in a directory of its own."""

    def __init__(self, bench, phase):
        self.bench = bench
        self.program, before, self.num_runs, self.arguments = PHASES[phase]
        self.phase = phase
        # The directory that fails lies in one that does not.
        self.room = pathlib.Path(tempfile.mkdtemp(prefix=f"{phase}.", dir=bench.folder))
        self.place = self.room / "d"
        if before is None:
            self.place.mkdir()
        else:
            shutil.copytree(bench.folder / f"state-{before}", self.place,
                            ignore=shutil.ignore_patterns("clients", "*.lock"))
        self.file = self.place / "small.db"
        self.copy = self.place / "copy.db"
        self.orders = Orders(self.room / "orders")

    def command(self):
        if self.program == LOCAL:
            words = {"toml": self.bench.definition(self.num_runs), "db": self.file,
                     "copy": self.copy}
            return [self.bench.programs / LOCAL,
                    *(word.format(**words) for word in self.arguments)]
        return [self.bench.programs / SERVED, self.bench.definition(self.num_runs), "--directory",
                self.place, "--bind", f"ipc://{self.room}/w", "--bind-clients",
                f"ipc://{self.room}/c", "--exit-when-done", "--time-scale", "0.05"]

    def carry_out(self):
        """@return Exit code and log of the program."""
        environment = {**os.environ, "LD_PRELOAD": str(self.bench.faulty_calls),
                       "PROOFMASS_FAULTY_DIRECTORY": str(self.place),
                       "PROOFMASS_FAULTY_ORDERS": str(self.orders.file), "TMPDIR": str(self.room)}
        log = self.room / "log"
        worker = None
        with open(log, "wb") as stream:
            program = subprocess.Popen(self.command(), cwd=self.room, env=environment,
                                       stdin=subprocess.DEVNULL, stdout=stream, stderr=stream,
                                       start_new_session=True)
        if self.program == SERVED:
            worker = subprocess.Popen(
                [self.bench.programs / "proofmass-worker", "--connect", f"ipc://{self.room}/w",
                 "--threads", "1", "--no-supervisor"], stderr=subprocess.DEVNULL)
        try:
            try:
                program.wait(HEAL_AFTER_S)
            except subprocess.TimeoutExpired:
                self.orders.clear()
                try:
                    program.wait(END_MAX_S)
                except subprocess.TimeoutExpired:
                    raise Failure(f"hangs {END_MAX_S:g} s after the fault has ended: "
                                  f"{log.read_text(errors='replace')[-500:]}") from None
        finally:
            self.orders.clear()
            if program.poll() is None:
                os.killpg(program.pid, signal.SIGKILL)
                program.wait()
            if worker is not None:
                worker.kill()
                worker.wait()
        return program.returncode, log.read_text(errors="replace")

    def close(self):
        shutil.rmtree(self.room, ignore_errors=True)


def require(condition, text):
    if not condition:
        raise Failure(text)


def check_whole(attempt, digest, log):
    """The file, or the copy of it, is what it should be after exit code 0."""
    file = attempt.copy if attempt.phase == "backup" else attempt.file
    try:
        found = verified_digest(attempt.bench.programs, file, is_null=True)
    except Failure as failure:
        raise Failure(f"{failure}\nthe program ended with 0 and said: {log[-700:]}") from None
    require(found == digest, f"{file.name} has the digest {found}")


def check_end(code, log):
    require(code >= 0 and not ABORT_MARKS.search(log), f"ended with {code}: {log[-700:]}")
    require(code == 0 or REFUSAL.search(log), f"ended with {code} and no reason: {log[-700:]}")


def try_point(bench, point):
    attempt = Attempt(bench, point.phase)
    try:
        before = rows_of(attempt.file)
        attempt.orders.set([point.call], getattr(errno, point.error), point.number,
                           NEVER if point.lasts else point.number)
        code, log = attempt.carry_out()
        check_end(code, log)
        after = rows_of(attempt.file)
        require(before <= after, f"{len(before - after)} stored runs are gone")
        is_partial = attempt.phase in ("backup_killed", "report")
        digest = None if is_partial else bench.digests[attempt.num_runs]
        if code == 0 and digest is not None:
            check_whole(attempt, digest, log)
        if attempt.phase.startswith("backup") and code != 0:
            require(not attempt.copy.exists() or rows_of(attempt.copy) == before,
                    "a copy is there that is not whole")
            attempt.copy.unlink(missing_ok=True)
        if code != 0 or is_partial:
            check_rerun(attempt, after, digest)
    finally:
        attempt.close()


def check_rerun(attempt, after, digest):
    """The same command again, with nothing in its way, and then the campaign is finished."""
    attempt.copy.unlink(missing_ok=True)
    code, log = attempt.carry_out()
    require(code == 0, f"undisturbed again it ended with {code}: {log[-700:]}")
    require(after <= rows_of(attempt.file), "stored runs are gone after the second time")
    if digest is not None:
        check_whole(attempt, digest, log)


def count_calls(bench, phase):
    """How many calls of each kind a phase makes."""
    attempt = Attempt(bench, phase)
    try:
        attempt.orders.set(CALLS, errno.EIO, NEVER, NEVER)
        code, log = attempt.carry_out()
        require(code == 0, f"{phase}, undisturbed, ended with {code}: {log[-700:]}")
        return attempt.orders.tally()
    finally:
        attempt.close()


def all_points(bench, options, pool):
    points = []
    tallies = pool.map(lambda phase: count_calls(bench, phase), options.phases)
    for phase, tally in zip(options.phases, tallies):
        for call, number_max in tally.items():
            for number in range(1, number_max + 1):
                errors = ERRORS[call] if options.all_errors else [
                    ERRORS[call][number % len(ERRORS[call])]]
                points += [Point(phase, call, error, number, lasts) for error in errors
                           for lasts in (False, True)]
    if options.sample:
        points = random.Random(options.seed).sample(points, min(options.sample, len(points)))
    return points


def parse_point(text):
    phase, call, error, number, how = text.split(":")
    return Point(phase, call, error, int(number), how == "on")


def result_of(bench, point):
    try:
        try_point(bench, point)
        return None
    except Failure as failure:
        return str(failure)
    except Exception:  # noqa: BLE001: a point that breaks says where.
        return traceback.format_exc()


def read_options():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--programs", type=pathlib.Path, required=True)
    parser.add_argument("--faulty-calls", type=pathlib.Path, help="the library to preload")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--phases", nargs="+", choices=PHASES, default=list(PHASES))
    parser.add_argument("--all-errors", action="store_true", help="each call with each error")
    parser.add_argument("--sample", type=int, help="so many points, drawn from all")
    parser.add_argument("--seed", type=int, default=1, help="of the sample")
    parser.add_argument("--point", nargs="+", help="repeat PHASE:CALL:ERROR:NUMBER:once|on")
    parser.add_argument("--directory", type=pathlib.Path, help="for campaign databases")
    options = parser.parse_args()
    options.programs = options.programs.resolve()
    if options.faulty_calls is None:
        options.faulty_calls = options.programs.parent / "tests" / "proofmass_faulty_calls.so"
    options.faulty_calls = options.faulty_calls.resolve()
    return options


def main():
    options = read_options()
    begin = time.monotonic()
    num_failed = 0
    with tempfile.TemporaryDirectory(prefix="system_call_sweep.", dir=options.directory) as folder:
        bench = Bench(options, pathlib.Path(folder))
        with concurrent.futures.ThreadPoolExecutor(options.jobs) as pool:
            points = list(map(parse_point, options.point)) if options.point else all_points(
                bench, options, pool)
            for point, failure in zip(points, pool.map(lambda one: result_of(bench, one), points)):
                if failure is not None:
                    num_failed += 1
                    print(f"FAILED {point}\n    {failure}", flush=True)
    print(f"{len(points) - num_failed} of {len(points)} calls failed without harm, in "
          f"{time.monotonic() - begin:.0f} s")
    return 1 if num_failed else 0


if __name__ == "__main__":
    sys.exit(main())
