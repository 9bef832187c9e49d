#!/usr/bin/env python3
"""What one coordinator bears: thousands of workers with many slots, thousands of connections, and a
coordinator that is killed while all of them are connected.

Usage: scale_benchmark.py BIN_DIRECTORY [options]

The workers are those of proofmass-swarm, whose runs take the time of real ones and compute nothing.
They have keys, unless told otherwise, and connect over TCP. Prints a line of JSON for each phase. Exit
code 1 if a limit is missed. The campaign database is written below --directory, on a disk.
"""

import argparse
import collections
import json
import os
import pathlib
import re
import resource
import signal
import subprocess
import sys
import tempfile
import time

from dispatch_benchmark import Program

AGENTS_PER_PROCESS = 500
IDLE_PER_PROCESS = 2000
PATIENCE_S = 900.0


def wait_until(what, condition):
    deadline = time.monotonic() + PATIENCE_S
    while not condition():
        if time.monotonic() > deadline:
            raise RuntimeError(f"never: {what}")
        time.sleep(0.05)


class Fleet:
    """A coordinator with keys at a port of its own, and the swarms that are connected to it."""

    def __init__(self, binaries, directory, options):
        self.binaries = binaries
        self.directory = directory
        self.options = options
        self.num_runs = 0
        self.workers = self.clients = "tcp://127.0.0.1:*"
        self.agents, self.idle = [], []
        self.keys = [] if options.without_keys else ["--keys", directory / "keys"]
        self.proofmass("keygen", "keys")
        self.coordinator = self.start_coordinator()

    def proofmass(self, *arguments):
        return subprocess.run([self.binaries / "proofmass", *map(str, arguments)],
                              cwd=self.directory, capture_output=True, text=True, check=False)

    def ask(self, *command):
        return self.proofmass(*command, "--connect", self.clients, *self.keys, "--timeout", 60)

    def start_coordinator(self, *further):
        coordinator = Program(
            [self.binaries / "proofmass-coordinator", "--directory", self.directory / "served",
             "--bind", self.workers, "--bind-clients", self.clients, "--log-format", "json",
             *self.keys, *further], "stderr")
        coordinator.wait_for(lambda line: line["event"] == "coordinator_started")
        started = next(line for _, line in coordinator.lines
                       if line["event"] == "coordinator_started")
        self.workers, self.clients = started["bind"], started["bind_clients"]
        return coordinator

    def start_swarm(self, *arguments):
        return Program([self.binaries / "proofmass-swarm", "--connect", self.workers, *self.keys,
                        *map(str, arguments)], "stdout")

    def add_agents(self, count):
        for first in range(0, count, AGENTS_PER_PROCESS):
            self.agents.append(self.start_swarm(
                "--workers", min(AGENTS_PER_PROCESS, count - first), "--first-number", first,
                "--slots", self.options.slots, "--batch-time-s", self.options.batch_time_s))

    def add_idle(self, count):
        for first in range(0, count, IDLE_PER_PROCESS):
            self.idle.append(self.start_swarm(
                "--workers", 0, "--idle", min(IDLE_PER_PROCESS, count - first)))

    def num_events(self, event, **fields):
        """In the log of the coordinator that runs now."""
        return sum(line["event"] == event and fields.items() <= line.items()
                   for _, line in self.coordinator.lines)

    def wait_for_agents(self):
        self.coordinator.wait_for(lambda line: line["event"] == "worker_registered",
                                  self.options.agents)

    def num_idle_connected(self):
        return sum(swarm.lines[-1][1]["num_idle_connected"] for swarm in self.idle if swarm.lines)

    def submit(self, num_more):
        """A campaign, or that many further runs of it."""
        self.num_runs += num_more
        (self.directory / "scale.toml").write_text(
            f'[campaign]\nname = "scale"\nseed = 1\nruns = {self.num_runs}\n')
        done = self.ask("submit", "scale.toml")
        if done.returncode != 0:
            raise RuntimeError("submit: " + done.stderr)

    def wait_for_end(self, num_before=0):
        self.coordinator.wait_for(lambda line: line["event"] == "campaign_finished",
                                  num_before + 1)

    def num_stored(self):
        done = self.ask("status", "--json")
        campaigns = json.loads(done.stdout)["campaigns"] if done.returncode == 0 else []
        return sum(campaign["num_done"] for campaign in campaigns)

    def network_bytes(self):
        """Of all connections that are open now, in both directions."""
        text = subprocess.run(["ss", "-tinH", f"sport = :{self.workers.rsplit(':', 1)[1]}"], capture_output=True,
                              text=True, check=True).stdout
        return sum(map(int, re.findall(r"bytes_(?:received|sent):(\d+)", text)))

    def descriptors(self):
        return len(os.listdir(f"/proc/{self.coordinator.process.pid}/fd"))

    def memory_mib(self, what):
        """VmRSS: now; VmHWM: at most."""
        status = pathlib.Path(f"/proc/{self.coordinator.process.pid}/status").read_text()
        return int(re.search(rf"{what}:\s+(\d+)", status)[1]) / 1024

    def memory_mb_max(self):
        return self.memory_mib("VmHWM") * 2**20 / 1e6

    def close(self):
        for program in [self.coordinator, *self.agents, *self.idle]:
            if program.usage is None:
                os.kill(program.process.pid, signal.SIGKILL)
                program.wait()


class Phase:
    """What happens between its beginning and figures()."""

    def __init__(self, fleet):
        self.fleet = fleet
        self.start = time.monotonic()
        self.cpu_s = fleet.coordinator.cpu_s()
        self.bytes = fleet.network_bytes()

    def figures(self):
        fleet, wall_s = self.fleet, time.monotonic() - self.start
        cpu_s = fleet.coordinator.cpu_s() - self.cpu_s
        answers = collections.Counter()
        unanswered_s = 0.0
        lines = [line for swarm in fleet.agents for when, line in swarm.lines if when > self.start]
        for line in lines:
            answers.update({int(ms): count for ms, count in
                            line["heartbeat_answers_by_ms"].items()})
            unanswered_s = max(unanswered_s, line["heartbeat_unanswered_s_max"])
        return {"wall_s": round(wall_s, 2), "coordinator_cores": round(cpu_s / wall_s, 3),
                "coordinator_cpu_s": round(cpu_s, 2),
                "network_bytes": fleet.network_bytes() - self.bytes,
                "heartbeats": answers.total(), "heartbeat_ms_median": quantile(answers, 0.5),
                "heartbeat_ms_p99": quantile(answers, 0.99),
                "heartbeat_ms_max": max(quantile(answers, 1.0), round(1e3 * unanswered_s)),
                "results_sent": sum(line["num_results"] for line in lines),
                "messages_unsent": sum(line["num_unsent"] for line in lines),
                "descriptors": fleet.descriptors(),
                "memory_mb_max": round(fleet.memory_mb_max()),
                "load": os.getloadavg()[0]}


def quantile(counts, fraction):
    """Of whole milliseconds; that of the last one for 1."""
    rank = fraction * counts.total()
    passed = 0
    for value in sorted(counts):
        passed += counts[value]
        if passed >= rank:
            return value
    return 0


def say(phase, **figures):
    print(json.dumps({"phase": phase, **figures}), flush=True)


def compute(fleet, num_runs):
    phase, before = Phase(fleet), fleet.num_events("campaign_finished")
    fleet.submit(num_runs)
    fleet.wait_for_end(before)
    figures = phase.figures()
    return {"num_runs": num_runs, "runs_per_s": round(num_runs / figures["wall_s"]),
            "bytes_per_run": round(figures["network_bytes"] / num_runs),
            "cpu_s_per_1000_runs": round(1e3 * figures["coordinator_cpu_s"] / num_runs, 5),
            "lost": fleet.num_events("worker_gone"),
            "sockets_reset": fleet.num_events("sockets_reset"), **figures}


def rest(fleet, duration_s):
    """Nothing is to be computed."""
    time.sleep(2.0)  # What the phase before has left.
    phase = Phase(fleet)
    time.sleep(duration_s)
    figures = phase.figures()
    figures["bytes_per_agent_s"] = round(
        figures["network_bytes"] / figures["wall_s"] / fleet.options.agents)
    return figures


def storm(fleet, num_runs):
    """The coordinator is killed when a third of the runs is stored, and started again at once."""
    done_before = fleet.num_stored()
    fleet.submit(num_runs)
    wait_until("a third", lambda: fleet.num_stored() >= done_before + num_runs // 3)
    lost = fleet.num_events("worker_gone")
    fleet.coordinator.process.send_signal(signal.SIGKILL)
    fleet.coordinator.wait()
    killed_at = time.monotonic()
    fleet.coordinator = fleet.start_coordinator()
    started_at = time.monotonic()
    phase = Phase(fleet)
    phase.bytes = 0
    fleet.wait_for_agents()
    registered_at = time.monotonic()
    wait_until("idle connections",
               lambda: fleet.num_idle_connected() == fleet.options.idle)
    connected_at = time.monotonic()
    fleet.wait_for_end()
    finished = next(line for _, line in fleet.coordinator.lines
                    if line["event"] == "campaign_finished")
    return {"num_runs": num_runs, "start_s": round(started_at - killed_at, 2),
            "all_registered_after_s": round(registered_at - killed_at, 2),
            "all_connected_after_s": round(connected_at - killed_at, 2),
            "finished_after_s": round(time.monotonic() - killed_at, 2),
            "lost": lost + fleet.num_events("worker_gone"),
            "delivered_twice": finished["duplicates"], "mismatches": fleet.num_events("result_mismatch"),
            "sockets_reset": fleet.num_events("sockets_reset"), **phase.figures()}


def problems_of_file(fleet):
    """Ends the coordinator in order and checks the campaign database, but for what null results are
    not: simulated."""
    fleet.coordinator.end()
    if fleet.coordinator.process.returncode != 0:
        raise RuntimeError(f"exit code = {fleet.coordinator.process.returncode} (must be 0)")
    text = fleet.proofmass("verify", "served/scale.db", "--fraction", "0").stdout
    lines = text.split("\n")
    expected = {"integrity": "ok", "results": f"{fleet.num_runs} of {fleet.num_runs} runs",
                "digest": f"of {fleet.num_runs} runs"}
    return [f"verify: {name}: {text}" for name, words in expected.items()
            if not any(line.startswith(name) and " ok " in line and words in line
                       for line in lines)]


def measure(fleet, options):
    begin = time.monotonic()
    fleet.add_agents(options.agents)
    fleet.wait_for_agents()
    say("registered", agents=options.agents, slots=options.slots,
        after_s=round(time.monotonic() - begin, 2), descriptors=fleet.descriptors())
    say("agents rest", **rest(fleet, options.rest_s))
    phases = [compute(fleet, options.runs)]
    say("agents compute", **phases[-1])
    begin = time.monotonic()
    fleet.add_idle(options.idle)
    wait_until("idle connections", lambda: fleet.num_idle_connected() == options.idle)
    say("connected", connections=options.agents + options.idle,
        after_s=round(time.monotonic() - begin, 2), descriptors=fleet.descriptors())
    say("all rest", **rest(fleet, options.rest_s))
    phases.append(compute(fleet, options.runs))
    say("all compute", **phases[-1])
    phases.append(storm(fleet, options.runs))
    say("storm", **phases[-1])
    file_bytes = (fleet.directory / "served" / "scale.db").stat().st_size
    say("file", bytes_per_run=round(file_bytes / fleet.num_runs))
    missed = [f"workers lost = {phase['lost']}" for phase in phases if phase["lost"] > 0]
    missed += [f"heartbeat_ms_max = {phase['heartbeat_ms_max']} (limit 15000)" for phase in phases
               if phase["heartbeat_ms_max"] > 15000]
    return missed + problems_of_file(fleet)


def read_options():
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("binaries", type=pathlib.Path, help="where the programs are")
    parser.add_argument("--agents", type=int, default=2000, help="workers")
    parser.add_argument("--slots", type=int, default=1024, help="of each: 16 a thread")
    parser.add_argument("--batch-time-s", type=float, default=2.7, help="of 16 runs")
    parser.add_argument("--idle", type=int, default=8000, help="connections beside the workers")
    parser.add_argument("--runs", type=int, default=2_000_000, help="in each of three phases")
    parser.add_argument("--rest-s", type=float, default=10.0, help="how long nothing is computed")
    parser.add_argument("--without-keys", action="store_true",
                        help="nothing is encrypted: a handshake with keys costs both sides time")
    parser.add_argument("--directory", type=pathlib.Path, help="for the campaign database")
    return parser.parse_args()


def main():
    options = read_options()
    hard = resource.getrlimit(resource.RLIMIT_NOFILE)[1]
    resource.setrlimit(resource.RLIMIT_NOFILE, (hard, hard))
    with tempfile.TemporaryDirectory(dir=options.directory, prefix="scale_benchmark.") as folder:
        fleet = Fleet(options.binaries.resolve(), pathlib.Path(folder), options)
        try:
            missed = measure(fleet, options)
        finally:
            fleet.close()
    for text in missed:
        print("scale_benchmark: missed: " + text, file=sys.stderr)
    return 1 if missed else 0


if __name__ == "__main__":
    sys.exit(main())
