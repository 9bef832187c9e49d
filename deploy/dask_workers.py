#!/usr/bin/env python3
"""Starts a proofmass-worker on each worker of a Dask cluster, and waits until all have ended.

Usage: dask_workers.py SCHEDULER OPTIONS_OF_PROOFMASS_WORKER...

The program must be in the path of the Dask workers, and the files that the options name must be on
their machines. Exit code 1 if a proofmass-worker failed.
"""

import subprocess
import sys

from distributed import Client


def run_worker(command):
    return subprocess.run(command, check=False).returncode


def main():
    scheduler, *options = sys.argv[1:]
    with Client(scheduler) as client:
        tasks = [client.submit(run_worker, ["proofmass-worker", *options], workers=[address],
                               pure=False)
                 for address in client.scheduler_info()["workers"]]
        return 1 if not tasks or any(client.gather(tasks)) else 0


if __name__ == "__main__":
    sys.exit(main())
