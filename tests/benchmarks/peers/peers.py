#!/usr/bin/env python3
"""What other systems need for work that takes no time, on this machine, with two workers each.

Usage: peers.py NUM_RUNS

Prints one JSON object a line: {"system": ..., "num_runs": ..., "wall_s": ..., "ms_per_run": ...}.
Debian's packages: parallel, python3-distributed, python3-ipyparallel. A system that is not
installed is reported as an error, not left out.
"""

import json
import os
import subprocess
import sys
import tempfile
import time

NUM_WORKERS = 2


def null_run(run):
    """Returns at once what stands for a result: twenty numbers."""
    return [float(run)] * 20


def report(system, num_runs, wall_s):
    figures = {"system": system, "num_runs": num_runs, "wall_s": wall_s}
    figures["ms_per_run"] = 1e3 * wall_s / num_runs
    print(json.dumps(figures), flush=True)


def measure_parallel(num_runs):
    """GNU parallel with its log on disk: a process a run, resumable."""
    with tempfile.TemporaryDirectory() as folder:
        command = ["parallel", "--will-cite", "-j", str(NUM_WORKERS), "--joblog",
                   os.path.join(folder, "log"), "true"]
        runs = "\n".join(str(run) for run in range(num_runs))
        start = time.monotonic()
        subprocess.run(command, input=runs, text=True, check=True, stdout=subprocess.DEVNULL)
        report("GNU parallel", num_runs, time.monotonic() - start)


def measure_dask(num_runs):
    """dask.distributed: scheduler and worker processes on loopback, results kept in memory only."""
    import distributed

    with distributed.LocalCluster(n_workers=NUM_WORKERS, threads_per_worker=1,
                                  dashboard_address=None) as cluster:
        with distributed.Client(cluster) as client:
            client.gather(client.map(null_run, range(100), pure=False))
            start = time.monotonic()
            client.gather(client.map(null_run, range(num_runs), pure=False))
            report("dask.distributed", num_runs, time.monotonic() - start)


def wait_for_engines(client):
    deadline = time.monotonic() + 60.0
    while len(client.ids) < NUM_WORKERS:
        if time.monotonic() > deadline:
            raise RuntimeError("ipyparallel: no engines within 60 s")
        time.sleep(0.1)


def measure_ipyparallel(num_runs, chunk):
    """ipyparallel: controller and engines; `chunk` runs a message."""
    import ipyparallel

    with tempfile.TemporaryDirectory() as folder:
        cluster = ipyparallel.Cluster(n=NUM_WORKERS, ipython_dir=folder)
        cluster.start_cluster_sync()
        try:
            client = cluster.connect_client_sync()
            wait_for_engines(client)
            view = client.load_balanced_view()
            view.map_sync(null_run, range(100))
            start = time.monotonic()
            view.map_sync(null_run, range(num_runs), chunksize=chunk)
            report(f"ipyparallel, {chunk} a message", num_runs, time.monotonic() - start)
        finally:
            cluster.stop_cluster_sync()


def main():
    num_runs = int(sys.argv[1])
    failed = False
    for measure in (lambda: measure_parallel(min(num_runs, 2000)),
                    lambda: measure_dask(min(num_runs, 20000)),
                    lambda: measure_ipyparallel(min(num_runs, 5000), 1),
                    lambda: measure_ipyparallel(num_runs, 256)):
        try:
            measure()
        except Exception as error:  # The others are still worth measuring.
            print(json.dumps({"error": f"{type(error).__name__}: {error}"}), flush=True)
            failed = True
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
