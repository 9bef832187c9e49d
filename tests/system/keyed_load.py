#!/usr/bin/env python3
"""Many connections with keys at one coordinator: workers that compute, connections that say nothing,
and connections that come and go. Memory and descriptors of the coordinator must stay flat.

    tests/system/keyed_load.py build/release/bin
    tests/system/keyed_load.py build/release/bin --working 200 --idle 200 --churn 50 --rounds 5

Prints a line of JSON a phase; exit code 1 if a limit is missed, 2 if the load cannot be brought about.
"""
import argparse
import resource
import sys
import tempfile
import time
from pathlib import Path

import checking

sys.path.append(str(checking.SOURCE / "tests/benchmarks"))
from scale_benchmark import Fleet, compute, problems_of_file, say, wait_until  # noqa: E402


class ChurnedFleet(Fleet):
    def ask(self, *command):
        for _ in range(5):  # A connection may be cut just then.
            done = super().ask(*command)
            if done.returncode == 0:
                break
        return done


def figures(fleet):
    return {"resident_mib": round(fleet.memory_mib("VmRSS"), 1),
            "peak_mib": round(fleet.memory_mib("VmHWM"), 1), "descriptors": fleet.descriptors()}


def settled_figures(fleet, descriptors_max, patience_s=120):
    """Once connections that were closed are gone; the figures show it if they stay."""
    end = time.monotonic() + patience_s
    while fleet.descriptors() > descriptors_max and time.monotonic() < end:
        time.sleep(0.05)
    return figures(fleet)


def churn(fleet, options):
    """The figures after the first round and after the last one."""
    replacing = fleet.start_swarm("--workers", 0, "--idle", 2 * options.churn, "--churn", options.churn)
    fleet.idle.append(replacing)

    def num_replaced():
        return replacing.lines[-1][1]["num_idle_replaced"] if replacing.lines else 0

    wait_until("churn", lambda: num_replaced() > 0)
    rounds = []
    for _ in range(options.rounds):
        enough = num_replaced() + options.churn
        wait_until("replaced connections", lambda: num_replaced() >= enough)
        compute(fleet, options.runs // 10)
        rounds.append(figures(fleet))
        say("churn", replaced=num_replaced(), **rounds[-1])
    return rounds[0], rounds[-1]


def run(fleet, options):
    failures = []

    def check(what, is_met):
        if not is_met:
            failures.append(what)

    say("empty", **figures(fleet))
    begin = time.monotonic()
    fleet.agents.append(fleet.start_swarm("--workers", options.agents, "--runs-held", 64))
    fleet.wait_for_agents()
    registered_after_s = time.monotonic() - begin
    compute(fleet, options.runs)
    working = figures(fleet)
    say("working", connections=options.agents, registered_after_s=round(registered_after_s, 1), **working)

    begin = time.monotonic()
    fleet.add_idle(options.idle)
    wait_until("idle connections", lambda: fleet.num_idle_connected() == options.idle)
    connected_after_s = time.monotonic() - begin
    compute_s = compute(fleet, options.runs)["wall_s"]
    idle = figures(fleet)
    say("idle", connections=options.agents + options.idle,
        connected_after_s=round(connected_after_s, 1), compute_s=compute_s, **idle)
    check("a descriptor for each connection",
          idle["descriptors"] - working["descriptors"] <= options.idle + 10)

    first, last = churn(fleet, options)
    check("memory flat while connections come and go",
          last["resident_mib"] <= 1.1 * first["resident_mib"] + 8)
    check("descriptors flat while connections come and go",
          last["descriptors"] <= idle["descriptors"] + 3 * options.churn + 50)

    for swarm in fleet.idle:
        swarm.process.kill()
        swarm.wait()
    compute(fleet, options.runs // 10)
    after = settled_figures(fleet, working["descriptors"] + 10)
    say("after", **after)
    check("descriptors given back", after["descriptors"] <= working["descriptors"] + 10)
    check("memory given back", after["resident_mib"] <= 1.1 * idle["resident_mib"] + 8)
    check("nobody lost", fleet.num_events("worker_gone", reason="silent") == 0)
    return failures + problems_of_file(fleet)


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("programs", type=Path, help="directory of the programs")
    parser.add_argument("--working", dest="agents", type=int, default=1000, help="workers that compute")
    parser.add_argument("--idle", type=int, default=10000, help="connections that say nothing")
    parser.add_argument("--churn", type=int, default=200, help="connections replaced each second")
    parser.add_argument("--rounds", type=int, default=10, help="looks at the coordinator meanwhile")
    parser.add_argument("--runs", type=int, default=20000, help="runs computed in each phase")
    options = parser.parse_args(namespace=argparse.Namespace(without_keys=False))
    hard = resource.getrlimit(resource.RLIMIT_NOFILE)[1]
    resource.setrlimit(resource.RLIMIT_NOFILE, (hard, hard))
    with tempfile.TemporaryDirectory(prefix="proofmass-load-") as directory:
        fleet = ChurnedFleet(options.programs.resolve(), Path(directory), options)
        try:
            failures = run(fleet, options)
        except RuntimeError as error:
            print(f"keyed_load: {error}", *fleet.coordinator.lines[-20:], sep="\n", file=sys.stderr)
            return 2
        finally:
            fleet.close()
    for failure in failures:
        print("keyed_load: missed: " + failure, file=sys.stderr)
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
