#!/usr/bin/env python3
"""What coordinator, wire and durable store cost for each run, with runs that take no time; with
thousands of workers, see scale_benchmark.py.

Usage: dispatch_benchmark.py BIN_DIRECTORY [options]

Prints a table and, with --json, writes the figures to a file. Exit code 1 if a limit is missed.
The campaign databases are written below --directory, which should be on a disk: commits are durable.
"""

import argparse
import json
import os
import pathlib
import platform
import signal
import subprocess
import sys
import tempfile
import threading
import time

TIME_MAX_S = 600.0


class Program:
    """A process whose lines of JSON are read as they come."""

    def __init__(self, command, stream):
        self.process = subprocess.Popen(command, **{stream: subprocess.PIPE}, text=True)
        self.lines = []  # (time of arrival, object)
        self.arrival = threading.Condition()
        self.is_silent = False  # It has said all that it will ever say.
        self.usage = None
        pipe = getattr(self.process, stream)
        threading.Thread(target=self._read, args=(pipe,), daemon=True).start()

    def _read(self, pipe):
        for line in pipe:
            if not line.startswith("{"):
                print(line, end="", file=sys.stderr)
                continue
            with self.arrival:
                self.lines.append((time.monotonic(), json.loads(line)))
                self.arrival.notify_all()
        with self.arrival:
            self.is_silent = True
            self.arrival.notify_all()

    def wait_for(self, is_wanted, count=1):
        """The time at which the wanted line, or the last of so many, came."""
        def found():
            times = [when for when, line in self.lines if is_wanted(line)]
            return times[count - 1] if len(times) >= count else None

        with self.arrival:
            self.arrival.wait_for(lambda: self.is_silent or found() is not None, TIME_MAX_S)
            if found() is None:
                raise RuntimeError(f"{self.process.args[0]}: did not say what was waited for")
            return found()

    def cpu_s(self):
        fields = pathlib.Path(f"/proc/{self.process.pid}/stat").read_text().rsplit(")", 1)[1].split()
        return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")

    def end(self):
        """Asks it to end, unless it has been waited for."""
        if self.usage is None:
            self.process.send_signal(signal.SIGTERM)
            self.wait()

    def wait(self):
        """Afterwards its use of memory is known."""
        _, status, self.usage = os.wait4(self.process.pid, 0)
        self.process.returncode = os.waitstatus_to_exitcode(status)

    def memory_mb_max(self):
        return self.usage.ru_maxrss * 1024 / 1e6


class Service:
    """A coordinator without campaigns, and programs that serve it."""

    def __init__(self, binaries, parent):
        self.binaries = binaries
        self.folder = tempfile.TemporaryDirectory(dir=parent, prefix="dispatch_benchmark.")
        self.directory = pathlib.Path(self.folder.name)
        self.endpoint = f"ipc://{self.directory}/workers"
        self.coordinator = Program(
            [binaries / "proofmass-coordinator", "--directory", self.directory,
             "--bind", self.endpoint, "--log-format", "json"], "stderr")
        self.others = []
        self.coordinator.wait_for(lambda line: line["event"] == "coordinator_started")

    def __enter__(self):
        return self

    def __exit__(self, *error):
        self.close()
        self.folder.cleanup()

    def close(self):
        """The coordinator tells the others to end."""
        self.coordinator.end()
        for other in self.others:
            if other.usage is None:
                other.wait()

    def add(self, program, *arguments, stream):
        command = [self.binaries / program, "--connect", self.endpoint, *map(str, arguments)]
        self.others.append(Program(command, stream))
        return self.others[-1]

    def wait_for_workers(self, count):
        return self.coordinator.wait_for(lambda line: line["event"] == "worker_registered", count)

    def run_campaign(self, num_runs):
        """Wall time and the coordinator's processor time from submission to the last commit."""
        file = self.directory / "null.toml"
        file.write_text(f'[campaign]\nname = "null"\nseed = 1\nruns = {num_runs}\n')
        cpu_s = self.coordinator.cpu_s()
        start = time.monotonic()
        subprocess.run([self.binaries / "proofmass", "submit", file, "--json", "--connect",
                        f"ipc://{self.directory}/clients"], check=True, stdout=subprocess.DEVNULL)
        end = self.coordinator.wait_for(lambda line: line["event"] == "campaign_finished")
        return {"num_runs": num_runs, "wall_s": end - start,
                "ms_per_run": 1e3 * (end - start) / num_runs,
                "coordinator_cpu_ms_per_run": 1e3 * (self.coordinator.cpu_s() - cpu_s) / num_runs}

    def file_mb(self):
        return (self.directory / "null.db").stat().st_size / 1e6


def measure_batches(service, num_runs):
    """Two worker processes with one thread each, which compute batches of 16 runs."""
    workers = [service.add("proofmass-null-worker", "--threads", 1, "--no-supervisor",
                           "--log-format", "json", stream="stderr") for _ in range(2)]
    service.wait_for_workers(len(workers))
    worker_cpu_s = sum(worker.cpu_s() for worker in workers)
    figures = service.run_campaign(num_runs)
    worker_cpu_s = sum(worker.cpu_s() for worker in workers) - worker_cpu_s
    figures["worker_cpu_ms_per_run"] = 1e3 * worker_cpu_s / num_runs
    service.close()
    figures["coordinator_memory_mb"] = service.coordinator.memory_mb_max()
    figures["file_mb"] = service.file_mb()
    return figures


def measure_one_by_one(service, num_runs, num_workers):
    """Each worker has one run at a time: a lease, a result and an acknowledgement for every run."""
    # A worker that says that its runs are long is lent no more than it asks for.
    swarm = service.add("proofmass-swarm", "--workers", num_workers, "--runs-held", 1,
                        "--elapsed-s", 10, stream="stdout")
    swarm.wait_for(lambda line: line["num_registered"] == num_workers)
    start = time.monotonic()
    figures = service.run_campaign(num_runs)
    service.close()
    medians = [line["acknowledgement_s_median"] for when, line in swarm.lines if when > start]
    return {"num_workers": num_workers, "acknowledgement_ms_median": 1e3 * max(medians), **figures}


def row(name, value, unit, limit=None):
    return {"name": name, "value": value, "unit": unit, "limit": limit}


def rows_of(figures):
    batches, single = figures["batches"], figures["one_by_one"]
    return [
        row(f"in batches, {batches['num_runs']} runs, 2 workers", batches["ms_per_run"], "ms/run",
            0.02),
        row("  processor time of the coordinator", batches["coordinator_cpu_ms_per_run"], "ms/run"),
        row("  processor time of the workers", batches["worker_cpu_ms_per_run"], "ms/run"),
        row("  memory of the coordinator, at most", batches["coordinator_memory_mb"], "MB", 300.0),
        row("  campaign database", batches["file_mb"], "MB"),
        row(f"one by one, {single['num_runs']} runs, {single['num_workers']} workers",
            single["ms_per_run"], "ms/run", 0.1),
        row("  processor time of the coordinator", single["coordinator_cpu_ms_per_run"], "ms/run"),
        row("  acknowledged after, median", single["acknowledgement_ms_median"], "ms"),
    ]


def is_missed(line):
    return line["limit"] is not None and line["value"] > line["limit"]


def print_table(rows):
    for line in rows:
        limit = "" if line["limit"] is None else f"  (limit {line['limit']:g}"
        limit += "" if line["limit"] is None else ", MISSED)" if is_missed(line) else ")"
        print(f"{line['name']:<52} {line['value']:>10.4g} {line['unit']}{limit}")


def read_options():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("binaries", type=pathlib.Path, help="where the programs are")
    parser.add_argument("--runs", type=int, default=200_000, help="in batches")
    parser.add_argument("--single-runs", type=int, default=50_000, help="one by one")
    parser.add_argument("--single-workers", type=int, default=64, help="one by one")
    parser.add_argument("--directory", type=pathlib.Path, help="for campaign databases")
    parser.add_argument("--json", type=pathlib.Path, help="file for the figures")
    return parser.parse_args()


def main():
    options = read_options()

    def with_service(measure, *arguments):
        with Service(options.binaries.resolve(), options.directory) as service:
            return measure(service, *arguments)

    figures = {
        "machine": {"processors": os.cpu_count(), "system": platform.platform(),
                    "load_before": os.getloadavg()[0]},
        "batches": with_service(measure_batches, options.runs),
        "one_by_one": with_service(measure_one_by_one, options.single_runs,
                                   options.single_workers),
    }
    figures["machine"]["load_after"] = os.getloadavg()[0]
    rows = rows_of(figures)
    print_table(rows)
    if options.json:
        options.json.write_text(json.dumps(figures, indent=2) + "\n")
    return 1 if any(map(is_missed, rows)) else 0


if __name__ == "__main__":
    sys.exit(main())
