#!/usr/bin/env python3
"""Computes a campaign in two ways that deploy/README.md describes, each of which must end with the
digest of `proofmass run`:

- all connections, with keys, pass through forwarders of TCP, as ssh -L makes them;
- the workers are started by deploy/dask_workers.py on the two workers of a Dask cluster, of which
  one is lost the next time.

Needs Debian's python3-distributed. Exit code 0 if all holds, 1 if not; 77 if it cannot run, but 1 if
the environment has CI.
"""

import json
import os
import re
import socket
import sqlite3
import subprocess
import tempfile
import threading
from pathlib import Path

import checking
from checking import wait_until

DEPLOY = checking.SOURCE / "deploy"
PYTHON = "/usr/bin/python3"  # Debian's, for which its packages are.
NUM_RUNS = 64
PATIENCE_S = 600


class Forwarder:
    """Passes on what comes to a port of its own, in both directions."""

    def __init__(self, port):
        self.target = ("127.0.0.1", port)
        self.num_connections = 0
        self.listener = socket.create_server(("127.0.0.1", 0))
        self.port = self.listener.getsockname()[1]
        threading.Thread(target=self.accept, daemon=True).start()

    def accept(self):
        while True:
            near = self.listener.accept()[0]
            try:
                far = socket.create_connection(self.target)
            except OSError:
                near.close()
                continue
            self.num_connections += 1
            for source, sink in ((near, far), (far, near)):
                threading.Thread(target=self.copy, args=(source, sink), daemon=True).start()

    @staticmethod
    def copy(source, sink):
        try:
            while data := source.recv(65536):
                sink.sendall(data)
        except OSError:
            pass
        for end in (source, sink):
            try:
                end.shutdown(socket.SHUT_RDWR)
            except OSError:
                pass  # The other direction has ended it.


class Campaign:
    """A coordinator with keys on loopback, without any campaign yet."""

    def __init__(self, programs, directory):
        self.directory = directory
        self.environment = {**os.environ, "PATH": f"{programs}:{os.environ['PATH']}"}
        self.processes = []
        self.command("proofmass", "keygen", "keys")
        checking.write_short_campaign(programs, directory, NUM_RUNS)
        self.start("coordinator", "proofmass-coordinator", "--directory", "served", "--keys", "keys",
                   "--bind", "tcp://127.0.0.1:*", "--bind-clients", "tcp://127.0.0.1:*")
        log = directory / "coordinator.log"
        wait_until("coordinator", lambda: "coordinator_started" in log.read_text())
        self.worker_port, self.client_port = map(int, re.search(
            r"bind=\S+:(\d+) bind_clients=\S+:(\d+)", log.read_text()).groups())

    def command(self, *words):
        done = subprocess.run(words, cwd=self.directory, env=self.environment, text=True,
                              capture_output=True, check=False)
        if done.returncode != 0:
            raise AssertionError(f"{' '.join(words)}: {done.returncode}: {done.stderr}")
        return done.stdout

    def start(self, name, *words):
        with open(self.directory / f"{name}.log", "wb") as log:
            self.processes.append(subprocess.Popen(words, cwd=self.directory, stdout=log,
                                                   stderr=log, env=self.environment))
        return self.processes[-1]

    def ask(self, port, *words):
        return self.command("proofmass", *words, "--keys", "keys", "--connect",
                            f"tcp://127.0.0.1:{port}")

    def submit(self, port, name):
        self.ask(port, "submit", "short.toml", "--name", name)

    def wait_for_end(self, port, name):
        def is_finished():
            campaigns = json.loads(self.ask(port, "status", "--json"))["campaigns"]
            return any(one["name"] == name and one["phase"] == "finished" for one in campaigns)
        wait_until(f"end of {name}", is_finished)

    def digest(self, file):
        return json.loads(self.command("proofmass", "report", file, "--json"))["digest"]

    def num_workers(self, name):
        """Those that delivered results of a campaign."""
        with sqlite3.connect(self.directory / "served" / f"{name}.db") as database:
            return database.execute(
                "SELECT count(*) FROM worker WHERE num_results > 0").fetchone()[0]

    def close(self):
        for process in reversed(self.processes):
            process.terminate()
            process.wait(PATIENCE_S)


def check_tunnel(campaign):
    workers, clients = Forwarder(campaign.worker_port), Forwarder(campaign.client_port)
    worker = campaign.start("tunnel-worker", "proofmass-worker", "--threads", "1", "--keys", "keys",
                            "--connect", f"tcp://127.0.0.1:{workers.port}", "--idle-timeout", "2")
    campaign.submit(clients.port, "tunnel")
    campaign.wait_for_end(clients.port, "tunnel")
    assert worker.wait(PATIENCE_S) == 0, "the worker's exit code"
    assert workers.num_connections == 1 and clients.num_connections >= 2, "the forwarders were used"


def check_dask(campaign):
    port = socket.create_server(("127.0.0.1", 0)).getsockname()[1]
    campaign.start("scheduler", "dask-scheduler", "--host", "127.0.0.1", "--port", str(port),
                   "--no-dashboard")
    dask_workers = [
        campaign.start(f"dask-{number}", "dask-worker", f"tcp://127.0.0.1:{port}", "--nthreads", "1",
                       "--no-dashboard", "--local-directory", str(campaign.directory))
        for number in (1, 2)
    ]
    for number in (1, 2):
        log = campaign.directory / f"dask-{number}.log"
        wait_until("dask-worker", lambda log=log: "Registered to" in log.read_text())
    command = (PYTHON, str(DEPLOY / "dask_workers.py"), f"tcp://127.0.0.1:{port}", "--connect",
               f"tcp://127.0.0.1:{campaign.worker_port}", "--keys", str(campaign.directory / "keys"),
               "--threads", "1", "--idle-timeout")
    recipe = campaign.start("recipe", *command, "5")
    log = campaign.directory / "coordinator.log"
    before = 1  # The worker behind the tunnel.
    wait_until("workers", lambda: log.read_text().count("worker_registered") == before + 2)
    campaign.submit(campaign.client_port, "dask")
    campaign.wait_for_end(campaign.client_port, "dask")
    assert recipe.wait(PATIENCE_S) == 0, "the exit code of dask_workers.py"
    assert campaign.num_workers("dask") == 2, "both workers delivered"
    recipe = campaign.start("recipe-2", *command, "20")
    wait_until("workers", lambda: log.read_text().count("worker_registered") == before + 4)
    dask_workers[1].terminate()
    assert recipe.wait(PATIENCE_S) == 1, "the exit code of dask_workers.py after a loss"


def main():
    programs = checking.parser_of(__doc__).parse_args().programs.resolve()
    if subprocess.run([PYTHON, "-c", "import distributed"], capture_output=True,
                      check=False).returncode != 0:
        checking.skip("no python3-distributed (deploy/install-deps.sh installs it)")
    with tempfile.TemporaryDirectory(prefix="cluster_check.") as directory:
        campaign = Campaign(programs, Path(directory))
        try:
            with checking.failure_told(lambda: Path(directory).glob("*.log")):
                check_tunnel(campaign)
                check_dask(campaign)
                campaign.command("proofmass", "run", "short.toml", "--db", "alone.db")
                alone = campaign.digest("alone.db")
                for name in ("tunnel", "dask"):
                    assert campaign.digest(f"served/{name}.db") == alone, f"the digest of {name}"
        finally:
            campaign.close()
    print("tunnel and Dask: the digest of `proofmass run`")


if __name__ == "__main__":
    main()
