#!/usr/bin/env python3
"""One coordinator with keys for an hour: workers that are killed, stopped and started again,
connections that come and go, strangers without keys that send rubbish and endless frames, and a
campaign that grows all the time.

    tests/system/soak.py build/release/bin
    tests/system/soak.py build/release/bin --minutes 3

Prints a line of JSON every ten seconds. At the end the file must be whole with all runs in it, and
memory and descriptors must not have grown between the second quarter of the time and the last.
Exit code 1 if they have, 2 if the campaign stands still.
"""
import argparse
import random
import resource
import signal
import socket
import statistics
import sys
import tempfile
import threading
import time

from keyed_load import Load, NotReached, say

SIGNALS = [signal.SIGKILL, signal.SIGTERM, signal.SIGSTOP]


class Strangers(threading.Thread):
    """Peers without keys, eight at a time, for both addresses."""

    def __init__(self, load, seed):
        super().__init__(daemon=True)
        self.random = random.Random(seed)
        self.ports = [int(endpoint.rsplit(":", 1)[1])
                      for endpoint in (load.workers_endpoint, load.clients_endpoint)]
        self.is_over = threading.Event()
        self.count = 0

    def run(self):
        peers = []
        while not self.is_over.wait(0.05):
            try:
                if len(peers) >= 8:
                    peers.pop(self.random.randrange(8)).close()
                peer = socket.create_connection(("127.0.0.1", self.random.choice(self.ports)), 5)
                peer.settimeout(1)
                peers.append(peer)
                peer.sendall(self.speech())
                self.count += 1
            except OSError:  # Cut off, as it should be.
                continue

    def speech(self):
        mechanism = self.random.choice([b"CURVE", b"NULL", b"PLAIN"])
        greeting = b"\xff" + bytes(8) + b"\x7f\x03\x01" + mechanism.ljust(52, b"\0")
        kind = self.random.randrange(4)
        if kind == 0:
            return self.random.randbytes(1000)
        if kind == 1:  # The head of a frame of a tebibyte.
            return greeting + b"\x06" + (1 << 40).to_bytes(8, "big") + bytes(100000)
        if kind == 2:  # A mebibyte without its end.
            return greeting + b"\x06" + (1 << 20).to_bytes(8, "big") + bytes((1 << 20) - 1)
        return greeting + b"\x04\x26\x05READY" + self.random.randbytes(2000)


class Workers:
    """Real worker processes of which one is hit now and then."""

    def __init__(self, load, count, seed):
        self.load = load
        self.random = random.Random(seed)
        self.num_started = 0
        self.processes = [self.start() for _ in range(count)]

    def start(self):
        self.num_started += 1
        name = f"worker-{self.num_started}"
        return self.load.start(name, "proofmass-null-worker", "--connect",
                               self.load.workers_endpoint, "--keys", "keys", "--name", name,
                               "--threads", "1", "--run-time", "0.002", "--max-walltime", "600")

    def hit_one(self):
        index = self.random.randrange(len(self.processes))
        number = self.random.choice(SIGNALS)
        process = self.processes[index]
        if process.poll() is None:
            process.send_signal(number)
        if number == signal.SIGSTOP:
            time.sleep(self.random.uniform(0, 2))
            process.send_signal(signal.SIGCONT)
        else:
            process.wait(150)
        if process.poll() is not None:
            self.load.processes.remove(process)
            self.processes[index] = self.start()


def soak(load, options):
    load.swarm("churn", "--workers", 0, "--idle", 200, "--churn", 50)
    workers = Workers(load, 3, options.seed)
    strangers = Strangers(load, options.seed)
    strangers.start()
    begin = time.monotonic()
    duration_s = 60 * options.minutes
    told_at = 0.0
    samples = []
    while time.monotonic() - begin < duration_s:
        load.compute(options.runs)
        workers.hit_one()
        time_s = time.monotonic() - begin
        figures = load.figures()
        samples.append((time_s / duration_s, figures))
        if time_s >= told_at + 10:
            told_at = time_s
            say("soak", time_s=round(time_s), runs=load.num_runs, workers=workers.num_started,
                strangers=strangers.count, resets=load.log().count(" sockets_reset "), **figures)
    strangers.is_over.set()
    strangers.join()
    return samples


def growth(samples, name):
    """Medians of the second and the last quarter."""
    quarters = [[figures[name] for share, figures in samples if first <= share < first + 0.25]
                for first in (0.25, 0.75)]
    return [statistics.median(quarter) for quarter in quarters]


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("programs", help="directory of the programs")
    parser.add_argument("--minutes", type=float, default=60)
    parser.add_argument("--runs", type=int, default=2000, help="to add to the campaign each time")
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    hard = resource.getrlimit(resource.RLIMIT_NOFILE)[1]
    resource.setrlimit(resource.RLIMIT_NOFILE, (hard, hard))
    failures = []
    with tempfile.TemporaryDirectory(prefix="proofmass-soak-") as directory:
        load = Load(options.programs, directory, memory_max_mib=256)
        try:
            samples = soak(load, options)
            peak_mib = load.figures()["peak_mib"]
            failures += load.problems_of_file()
        except (NotReached, OSError) as error:
            print(f"soak: {error!r}\n{load.log()[-3000:]}", file=sys.stderr)
            return 2
        finally:
            load.close()
    memory = growth(samples, "resident_mib")
    descriptors = growth(samples, "descriptors")
    say("end", runs=load.num_runs, resident_mib=memory, descriptors=descriptors, peak_mib=peak_mib)
    # What a coordinator knows of each run and of each worker that it has seen takes some room.
    if memory[1] > 1.25 * memory[0] + 8:
        failures.append(f"memory grows: {memory}")
    if descriptors[1] > 1.1 * descriptors[0] + 30:
        failures.append(f"descriptors grow: {descriptors}")
    for failure in failures:
        print("soak: missed: " + failure, file=sys.stderr)
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
