#!/usr/bin/env python3
"""What the live page costs a coordinator with thousands of workers and a million runs.

Usage: page_benchmark.py BIN_DIRECTORY [options]

The workers are those of proofmass-swarm, see scale_benchmark.py. Five viewers ask for a page each two
seconds, as its script does. Prints a line of JSON for each phase: processor time of the coordinator and of
each of its threads. Exit code 1 if a page that was asked for alone took longer than 0.2 s, or if the page's
threads cost more than 2 % of a core with five viewers, at rest or while runs are computed.
"""

import argparse
import os
import pathlib
import re
import resource
import socket
import statistics
import sys
import tempfile
import threading
import time
import urllib.request

from scale_benchmark import Fleet, say, wait_until

PATHS = ["", "workers", "workers?sort=throughput&page=100", "campaigns/scale",
         "campaigns/scale?events=2"]
FURTHER_PATHS = ["workers?filter=99", "metrics"]
ANSWER_S_MAX = 0.2
VIEWERS_CORES_MAX = 0.02


def free_port():
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        return listener.getsockname()[1]


class PageFleet(Fleet):
    """The coordinator serves a page and takes more workers than usual."""

    def start_coordinator(self):
        self.page_port = free_port()
        return super().start_coordinator(f"--page=127.0.0.1:{self.page_port}", "--workers-max",
                                         str(self.options.agents))

    def fetch(self, path):
        """Seconds and bytes of an answer."""
        begin = time.monotonic()
        with urllib.request.urlopen(f"http://127.0.0.1:{self.page_port}/{path}", timeout=30) as got:
            size = len(got.read())
        return time.monotonic() - begin, size

    def num_done(self):
        with urllib.request.urlopen(f"http://127.0.0.1:{self.page_port}/metrics",
                                    timeout=30) as got:
            return int(re.search(r'runs_finished_total{campaign="scale"} (\d+)',
                                 got.read().decode())[1])


class Viewers:
    """Five of them, each with a page of its own."""

    def __init__(self, fleet):
        self.fleet, self.times, self.is_over = fleet, [], threading.Event()
        self.threads = [threading.Thread(target=self.look, args=(path,)) for path in PATHS]
        for thread in self.threads:
            thread.start()

    def look(self, path):
        address = path + ("&" if "?" in path else "?") + "fragment=1"
        while not self.is_over.wait(2.0):
            self.times.append(self.fleet.fetch(address)[0])

    def end(self):
        self.is_over.set()
        for thread in self.threads:
            thread.join()


def thread_cpu_s(process_id):
    """Processor time of each thread of a process, by its id."""
    times = {}
    for task in pathlib.Path(f"/proc/{process_id}/task").iterdir():
        fields = (task / "stat").read_text().rsplit(")", 1)[1].split()
        times[int(task.name)] = (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
    return times


def watched(fleet, phase, duration_s, with_viewers):
    """Processor time of the coordinator in a phase, in cores: of all, and of each thread."""
    viewers = Viewers(fleet) if with_viewers else None
    time.sleep(5.0)  # What the first looks cost is none of this phase.
    process_id = fleet.coordinator.process.pid
    begin, before = time.monotonic(), thread_cpu_s(process_id)
    time.sleep(duration_s)
    after, elapsed_s = thread_cpu_s(process_id), time.monotonic() - begin
    threads = {thread: round((cpu_s - before.get(thread, 0.0)) / elapsed_s, 4)
               for thread, cpu_s in after.items()}
    figures = {"coordinator_cores": round(sum(threads.values()), 4), "thread_cores": threads}
    if viewers is not None:
        viewers.end()
        figures |= {"answers": len(viewers.times),
                    "answer_s_median": round(statistics.median(viewers.times), 4),
                    "answer_s_max": round(max(viewers.times), 4)}
    say(phase, **figures)
    return figures


def time_of_pages(fleet):
    worst = 0.0
    for path in PATHS + FURTHER_PATHS:
        fleet.fetch(path)  # The first one may wait for what nobody wanted before.
        time.sleep(0.5)
        times = [fleet.fetch(path) for _ in range(5)]
        middle, longest = statistics.median(time_s for time_s, _ in times), max(times)[0]
        worst = max(worst, longest)
        say("page", path=path, bytes=times[0][1], seconds_median=round(middle, 4),
            seconds_max=round(longest, 4))
    return worst


def cost_of_viewers(quiet, watched_by_five):
    """Cores that the threads take with viewers which rest without them: those of the page. What the
    page costs the other threads is less than their own times differ between two phases."""
    idle = [thread for thread, cores in quiet["thread_cores"].items() if cores < 0.005]
    return sum(watched_by_five["thread_cores"].get(thread, 0.0) for thread in idle)


def measure(fleet, options):
    fleet.add_agents(options.agents)
    fleet.wait_for_agents()
    say("registered", agents=options.agents)
    fleet.submit(options.runs)
    wait_until("runs", lambda: fleet.num_done() > 0)
    computing = [watched(fleet, "computing, nobody looks", options.watch_s, False),
                 watched(fleet, "computing, five viewers", options.watch_s, True)]
    fleet.wait_for_end()
    say("finished", runs=fleet.num_done())
    time.sleep(35.0)  # Until nobody has asked for so long that no snapshots are taken.
    resting = [watched(fleet, "at rest, nobody looks", options.watch_s, False),
               watched(fleet, "at rest, five viewers", options.watch_s, True)]
    worst = time_of_pages(fleet)
    costs = {"viewers_cores_at_rest": cost_of_viewers(*resting),
             "viewers_cores_computing": cost_of_viewers(*computing)}
    say("cost", **{name: round(cost, 4) for name, cost in costs.items()},
        memory_mb_max=round(fleet.memory_mb_max()))
    missed = [f"{name} = {cost:.4f} (limit {VIEWERS_CORES_MAX})"
              for name, cost in costs.items() if cost > VIEWERS_CORES_MAX]
    if worst > ANSWER_S_MAX:
        missed.append(f"seconds_max = {worst:.3f} (limit {ANSWER_S_MAX})")
    return missed


def read_options():
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("binaries", type=pathlib.Path, help="where the programs are")
    parser.add_argument("--agents", type=int, default=10_000, help="workers")
    parser.add_argument("--slots", type=int, default=16, help="of each")
    parser.add_argument("--batch-time-s", type=float, default=30.0, help="of 16 runs")
    parser.add_argument("--runs", type=int, default=1_000_000, help="of the campaign")
    parser.add_argument("--watch-s", type=float, default=30.0, help="length of each phase")
    parser.add_argument("--without-keys", action="store_true", help="nothing is encrypted")
    parser.add_argument("--directory", type=pathlib.Path, help="for the campaign database")
    return parser.parse_args()


def main():
    options = read_options()
    hard = resource.getrlimit(resource.RLIMIT_NOFILE)[1]
    resource.setrlimit(resource.RLIMIT_NOFILE, (hard, hard))
    with tempfile.TemporaryDirectory(dir=options.directory, prefix="page_benchmark.") as folder:
        fleet = PageFleet(options.binaries.resolve(), pathlib.Path(folder), options)
        try:
            missed = measure(fleet, options)
        finally:
            fleet.close()
    for text in missed:
        print("page_benchmark: missed: " + text, file=sys.stderr)
    return 1 if missed else 0


if __name__ == "__main__":
    sys.exit(main())
