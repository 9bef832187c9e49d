#!/usr/bin/env python3
"""Many connections with keys at one coordinator: workers that compute, connections that say nothing,
and connections that come and go. Memory and descriptors of the coordinator must stay flat.

    tests/system/keyed_load.py build/release/bin
    tests/system/keyed_load.py build/release/bin --working 200 --idle 200 --churn 50 --rounds 5

Prints a line of JSON a phase; exit code 1 if a limit is missed, 2 if the load cannot be brought about.
"""
import argparse
import functools
import json
import os
import re
import resource
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import checking

PATIENCE_S = 600
IDLE_PER_PROCESS = 2500  # Each needs two descriptors where it is made.


wait_until = functools.partial(checking.wait_until, limit_s=PATIENCE_S)


class Load:
    """A coordinator with keys in a directory, and those who connect to it."""

    def __init__(self, programs, directory, memory_max_mib=2048):
        self.programs = Path(programs).resolve()
        self.directory = Path(directory)
        self.processes = []
        self.num_runs = 1000
        subprocess.run([self.programs / "proofmass", "keygen", "keys"], cwd=directory, check=True,
                       stdout=subprocess.DEVNULL)
        subprocess.run([self.programs / "proofmass", "init", "paper.toml"], cwd=directory,
                       check=True, stdout=subprocess.DEVNULL)
        text = (self.directory / "paper.toml").read_text()
        text = re.sub(r'\nname = "[^"]*"', '\nname = "load"', text, count=1)
        (self.directory / "load.toml").write_text(text)
        self.coordinator = self.start(
            "coordinator", "proofmass-coordinator", "--directory", "served", "--keys", "keys",
            "--bind", "tcp://127.0.0.1:*", "--bind-clients", "tcp://127.0.0.1:*",
            "--memory-max", str(memory_max_mib))
        wait_until("start", lambda: "coordinator_started" in self.log())
        found = re.search(r"bind=(\S+) bind_clients=(\S+)", self.log())
        self.workers_endpoint, self.clients_endpoint = found.groups()

    def start(self, name, program, *arguments):
        with open(self.directory / (name + ".out"), "wb") as out, \
                open(self.directory / (name + ".err"), "wb") as err:
            process = subprocess.Popen([self.programs / program, *arguments], cwd=self.directory,
                                       stdout=out, stderr=err)
        self.processes.append(process)
        return process

    def swarm(self, name, *arguments):
        return self.start(name, "proofmass-swarm", "--connect", self.workers_endpoint, "--keys",
                          "keys", *map(str, arguments))

    def log(self):
        return (self.directory / "coordinator.err").read_text(errors="replace")

    def last_report(self, name):
        """The newest whole line of a swarm; nothing before there is one."""
        lines = (self.directory / (name + ".out")).read_text().split("\n")
        return json.loads(lines[-2]) if len(lines) > 1 else {}

    def num_finished(self):
        return self.log().count("campaign_finished ")

    def compute(self, num_more):
        """Has that many further runs computed."""
        before = self.num_finished()
        self.num_runs += num_more
        for _ in range(5):  # A connection may be cut just then.
            done = subprocess.run(
                [self.programs / "proofmass", "submit", "load.toml", "--runs", str(self.num_runs),
                 "--connect", self.clients_endpoint, "--keys", "keys", "--timeout", "60"],
                cwd=self.directory, capture_output=True, text=True)
            if done.returncode == 0:
                break
        else:
            raise AssertionError("submission: " + done.stderr)
        begin = time.monotonic()
        wait_until("runs", lambda: self.num_finished() > before)
        return time.monotonic() - begin

    def figures(self):
        process = Path("/proc") / str(self.coordinator.pid)
        status = dict(line.split(":\t", 1) for line in
                      (process / "status").read_text().splitlines() if ":\t" in line)
        return {"resident_mib": round(int(status["VmRSS"].split()[0]) / 1024, 1),
                "peak_mib": round(int(status["VmHWM"].split()[0]) / 1024, 1),
                "descriptors": len(os.listdir(process / "fd"))}

    def settled_figures(self, descriptors_max, patience_s=120):
        """Once connections that were closed are gone."""
        try:
            wait_until("descriptors", lambda: self.figures()["descriptors"] <= descriptors_max,
                       limit_s=patience_s)
        except AssertionError:
            pass  # The figures show it.
        return self.figures()

    def end(self, process, number=signal.SIGKILL):
        process.send_signal(number)
        return process.wait(PATIENCE_S)

    def close(self):
        for process in self.processes:
            if process.poll() is None:
                process.kill()
                process.wait()

    def problems_of_file(self):
        """Ends the coordinator in order and checks the campaign database, but for what null results are
        not: simulated."""
        if self.end(self.coordinator, signal.SIGTERM) != 0:
            raise AssertionError("an end in order: " + self.log()[-2000:])
        done = subprocess.run(
            [self.programs / "proofmass", "verify", "served/load.db", "--fraction", "0"],
            cwd=self.directory, capture_output=True, text=True)
        lines = done.stdout.split("\n")
        expected = {"integrity": "ok", "results": f"{self.num_runs} of {self.num_runs} runs",
                    "digest": f"of {self.num_runs} runs"}
        return [f"verify: {name}: {done.stdout}{done.stderr}" for name, text in expected.items()
                if not any(line.startswith(name) and " ok " in line and text in line
                           for line in lines)]


def say(phase, **figures):
    print(json.dumps({"phase": phase, **figures}), flush=True)


def run(load, options):
    failures = []

    def check(what, is_met):
        if not is_met:
            failures.append(what)

    say("empty", **load.figures())
    load.swarm("working", "--workers", options.working, "--runs-held", 64)
    begin = time.monotonic()
    wait_until("registered workers", lambda: load.last_report("working"))
    load.compute(options.runs)
    working = load.figures()
    say("working", connections=options.working, registered_after_s=round(time.monotonic() - begin, 1),
        **working)

    begin = time.monotonic()
    names = []
    for first in range(0, options.idle, IDLE_PER_PROCESS):
        names.append(f"idle-{first}")
        load.swarm(names[-1], "--workers", 0, "--idle",
                   min(IDLE_PER_PROCESS, options.idle - first))
    wait_until("idle connections", lambda: sum(
        load.last_report(name).get("num_idle_connected", 0) for name in names) == options.idle)
    connected_after_s = time.monotonic() - begin
    time_s = load.compute(options.runs)
    idle = load.figures()
    say("idle", connections=options.working + options.idle,
        connected_after_s=round(connected_after_s, 1), compute_s=round(time_s, 2), **idle)
    check("a descriptor for each connection",
          idle["descriptors"] - working["descriptors"] <= options.idle + 10)

    load.swarm("churn", "--workers", 0, "--idle", 2 * options.churn, "--churn", options.churn)
    wait_until("churn", lambda: load.last_report("churn").get("num_idle_replaced", 0) > 0)
    first = None
    for _ in range(options.rounds):
        replaced = load.last_report("churn")["num_idle_replaced"]
        wait_until("replaced connections", lambda: load.last_report("churn")["num_idle_replaced"]
                   >= replaced + options.churn)
        load.compute(options.runs // 10)
        last = load.figures()
        first = first or last
        say("churn", replaced=load.last_report("churn")["num_idle_replaced"], **last)
    check("memory flat while connections come and go",
          last["resident_mib"] <= 1.1 * first["resident_mib"] + 8)
    check("descriptors flat while connections come and go",
          last["descriptors"] <= idle["descriptors"] + 3 * options.churn + 50)

    for process in load.processes[2:]:
        load.end(process)
    load.compute(options.runs // 10)
    after = load.settled_figures(working["descriptors"] + 10)
    say("after", **after)
    check("descriptors given back", after["descriptors"] <= working["descriptors"] + 10)
    check("memory given back", after["resident_mib"] <= 1.1 * idle["resident_mib"] + 8)
    check("nobody lost", "reason=silent" not in load.log())
    return failures + load.problems_of_file()


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("programs", help="directory of the programs")
    parser.add_argument("--working", type=int, default=1000, help="workers that compute")
    parser.add_argument("--idle", type=int, default=10000, help="connections that say nothing")
    parser.add_argument("--churn", type=int, default=200, help="connections replaced each second")
    parser.add_argument("--rounds", type=int, default=10, help="looks at the coordinator meanwhile")
    parser.add_argument("--runs", type=int, default=20000, help="runs computed in each phase")
    options = parser.parse_args()
    hard = resource.getrlimit(resource.RLIMIT_NOFILE)[1]
    resource.setrlimit(resource.RLIMIT_NOFILE, (hard, hard))
    with tempfile.TemporaryDirectory(prefix="proofmass-load-") as directory:
        load = Load(options.programs, directory)
        try:
            failures = run(load, options)
        except AssertionError as error:
            print(f"keyed_load: never: {error}\n{load.log()[-3000:]}", file=sys.stderr)
            return 2
        finally:
            load.close()
    for failure in failures:
        print("keyed_load: missed: " + failure, file=sys.stderr)
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
