#!/usr/bin/env python3
"""Starts a proofmass-worker on each worker of a Dask cluster, and waits until all have ended.

Usage: dask_workers.py SCHEDULER OPTIONS_OF_PROOFMASS_WORKER...

The program must be in the path of the Dask workers, and the files that the options name must be on
their machines. Exit code 1 if a proofmass-worker failed, or the Dask worker that has it was lost.
"""

import subprocess
import sys

from distributed import Client, TimeoutError, wait


def run_worker(command):
    return subprocess.run(command, check=False).returncode


def main():
    if len(sys.argv) < 3:
        print(__doc__, file=sys.stderr)
        return 2
    scheduler, *options = sys.argv[1:]
    with Client(scheduler) as client:
        tasks = {client.submit(run_worker, ["proofmass-worker", *options], workers=[address],
                               pure=False): address
                 for address in client.nthreads()}
        is_failed = not tasks
        while tasks:
            try:
                wait(list(tasks), timeout=5, return_when="FIRST_COMPLETED")
            except TimeoutError:
                pass
            present = client.nthreads()
            for task in [task for task in tasks if task.done() or tasks[task] not in present]:
                # Without its Dask worker, a task would wait for ever.
                is_failed |= not task.done() or task.status != "finished" or task.result() != 0
                del tasks[task]
        return 1 if is_failed else 0


if __name__ == "__main__":
    sys.exit(main())
