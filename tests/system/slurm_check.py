#!/usr/bin/env python3
"""Runs a campaign by deploy/slurm/campaign.sbatch on a Slurm cluster of three nodes on this host.

The cluster is Debian's Slurm with one slurmd a node, all in one directory, on loopback. In turn:

- the job runs undisturbed;
- the node of a worker is killed, slurmctld is killed and started again, and the coordinator is
  killed, all in one job;
- a job is ended early, the workers of another one leave as it is about to end, and a third one goes
  on until all is computed;
- a coordinator beside the cluster gets workers by `proofmass factory`, of which one loses its node and
  one is queued again; the workers end when there is no more work;
- a campaign file that is not valid, and a directory into which another job computes, are refused.

The workers compute nothing: their results are made up, the same for a run wherever it is computed, and
batches take half a second on any machine. Each database must have the digest of `proofmass run` by such
workers. Needs root, slurmctld, slurmd and munged.
Exit code 0 if all holds, 1 if not; 77 without these, but 1 if the environment has CI.
"""

import contextlib
import json
import os
import re
import shutil
import signal
import socket
import subprocess
import tempfile
import time
from pathlib import Path

import checking
from checking import check, wait_until

NUM_NODES = 3
CONFIGURATION = """ClusterName=proofmass
SlurmctldHost={host}(127.0.0.1)
SlurmUser=root
SlurmdUser=root
AuthType=auth/munge
AuthInfo=socket={directory}/munge/socket,cred_expire=10
MpiDefault=none
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
JobAcctGatherType=jobacct_gather/none
SelectType=select/cons_tres
SelectTypeParameters=CR_Core
SchedulerType=sched/backfill
SchedulerParameters=sched_interval=1,bf_interval=1,batch_sched_delay=1
ReturnToService=2
SlurmctldPort={port}
SlurmctldTimeout=30
SlurmdTimeout=15
KillWait=5
StateSaveLocation={directory}/state
SlurmdSpoolDir={directory}/spool/%n
SlurmctldPidFile={directory}/slurmctld.pid
SlurmdPidFile={directory}/slurmd.%n.pid
SlurmctldLogFile={directory}/slurmctld.log
SlurmdLogFile={directory}/slurmd.%n.log
NodeName=n[1-{nodes}] NodeHostname={host} NodeAddr=127.0.0.1 \
Port=[{first}-{last}] CPUs=1 RealMemory=500
PartitionName=all Nodes=n[1-{nodes}] Default=YES MaxTime=INFINITE State=UP OverTimeLimit=0
"""


def free_ports(count):
    """The first of so many ports that nobody listens on."""
    for first in range(20000, 30000, count):
        sockets = [socket.socket() for _ in range(count)]
        try:
            for offset, listener in enumerate(sockets):
                listener.bind(("127.0.0.1", first + offset))
            return first
        except OSError:
            continue
        finally:
            for listener in sockets:
                listener.close()
    raise AssertionError("no ports are free")


def told_of(process, what):
    """A file of the process in /proc; nothing of one that has ended."""
    try:
        return Path(f"/proc/{process}/{what}").read_bytes()
    except OSError:
        return b""


def environment_of(process):
    pairs = told_of(process, "environ").split(b"\0")
    return dict(pair.split(b"=", 1) for pair in pairs if b"=" in pair)


def processes():
    return [int(path.name) for path in Path("/proc").iterdir() if path.name.isdigit()]


def kill(process):
    try:
        os.kill(process, signal.SIGKILL)
    except ProcessLookupError:
        pass


class Cluster:
    """Slurm and munge, with all that they write in one directory."""

    def __init__(self, directory):
        self.directory = directory
        for name in ("state", "spool", "munge"):
            (directory / name).mkdir(parents=True)
        (directory / "munge/key").write_bytes(os.urandom(1024))
        (directory / "munge/key").chmod(0o600)
        port = free_ports(NUM_NODES + 1)
        self.configuration = directory / "slurm.conf"
        self.configuration.write_text(
            CONFIGURATION.format(
                host=socket.gethostname().split(".")[0],
                directory=directory,
                nodes=NUM_NODES,
                port=port,
                first=port + 1,
                last=port + NUM_NODES,
            )
        )
        self.environment = {**os.environ, "SLURM_CONF": str(self.configuration)}

    def start(self):
        munge = self.directory / "munge"
        options = {"key-file": "key", "socket": "socket", "pid-file": "pid"}
        options |= {"log-file": "log", "seed-file": "seed"}
        arguments = [f"--{option}={munge / name}" for option, name in options.items()]
        self.run("munged", "--force", *arguments, stderr=subprocess.DEVNULL)
        self.start_controller()
        for node in range(1, NUM_NODES + 1):
            self.start_node(f"n{node}")
        idle = ["sinfo", "--noheader", "--states", "idle", "--format", "%D"]
        wait_until("the cluster", lambda: self.answer(*idle) == str(NUM_NODES))

    def start_controller(self):
        self.run("slurmctld", "-f", self.configuration)

    def start_node(self, node):
        self.run("slurmd", "-f", self.configuration, "-N", node)

    def run(self, *command, **options):
        subprocess.run(command, check=True, env=self.environment, **options)

    def answer(self, *command):
        """What a command prints; nothing while Slurm does not answer."""
        process = subprocess.run(command, env=self.environment, capture_output=True, text=True)
        return process.stdout.strip()

    def process_of(self, name):
        return int((self.directory / f"{name}.pid").read_text())

    def kill_controller(self, job):
        """When it has written down that the job runs: it ends jobs that it does not know."""
        saved = self.directory / "state/job_state"
        begin = time.time()
        self.run("scontrol", "update", f"JobId={job}", "Comment=saved")
        wait_until("the saved state", lambda: saved.stat().st_mtime > begin)
        kill(self.process_of("slurmctld"))

    def kill_node(self, node):
        """Its slurmd, and all that runs on it."""
        kill(self.process_of(f"slurmd.{node}"))
        for process in self.processes_of(node):
            kill(process)

    def processes_of(self, node=None):
        """Of jobs, with the slurmstepd that started each."""
        found = set()
        for process in processes():
            environment = environment_of(process)
            if environment.get(b"SLURM_CONF") != str(self.configuration).encode():
                continue
            name = environment.get(b"SLURMD_NODENAME")
            if name is None or node not in (None, name.decode()):
                continue
            found.add(process)
            parent = re.search(rb"PPid:\s*(\d+)", told_of(process, "status"))
            if parent and told_of(int(parent[1]), "comm").strip() == b"slurmstepd":
                found.add(int(parent[1]))
        return found

    def stop(self):
        for name in [f"slurmd.n{node}" for node in range(1, NUM_NODES + 1)] + ["slurmctld"]:
            if (self.directory / f"{name}.pid").exists():
                kill(self.process_of(name))
        for process in self.processes_of():
            kill(process)
        if (self.directory / "munge/pid").exists():
            kill(int((self.directory / "munge/pid").read_text()))


WORKER = """#!/bin/sh
exec '{programs}/proofmass-null-worker' --run-time "${{BATCH_TIME_S:-0.5}}" "$@"
"""


class Site:
    """Where people of the cluster work: the programs in the PATH, a campaign file, a disk."""

    def __init__(self, cluster, directory, programs, num_runs=2000):
        self.cluster = cluster
        self.directory = directory
        self.script = Path(__file__).resolve().parents[2] / "deploy/slurm/campaign.sbatch"
        for name in ("scratch", "bin"):
            (directory / name).mkdir(parents=True)
        shutil.copy(programs / "proofmass", directory / "bin")  # It starts the worker beside it.
        worker = directory / "bin/proofmass-worker"
        worker.write_text(WORKER.format(programs=programs))
        worker.chmod(0o755)
        self.environment = {
            **cluster.environment,
            "PATH": f"{directory / 'bin'}:{programs}:{cluster.environment['PATH']}",
            "TMPDIR": str(directory / "scratch"),
            "PROOFMASS_THREADS": "1",
        }
        checking.write_short_campaign(programs, directory, num_runs)

    def answer(self, *command, **more):
        return subprocess.run(
            command,
            cwd=self.directory,
            env={**self.environment, **more},
            stdout=subprocess.PIPE,
            text=True,
            check=False,
        )

    def proofmass(self, *arguments, **more):
        process = self.answer("proofmass", *arguments, **more)
        check(process.returncode == 0, f"proofmass {arguments} gives {process.returncode}")
        return process.stdout

    def digest(self, database):
        return checking.digest_of(self.proofmass("report", database))

    def reference(self):
        run = ("run", "short.toml", "--db", "reference.db", "--workers", "2", "--quiet")
        self.proofmass(*run, BATCH_TIME_S="0")
        return self.digest("reference.db")

    def submit(self, *arguments, **more):
        """Of the campaign, with arguments of sbatch; the number of the job."""
        process = self.answer(
            *("sbatch", "--parsable", "--time=20", "--output=%j.out", *arguments), **more
        )
        check(process.returncode == 0, f"sbatch {arguments} gives {process.returncode}")
        return process.stdout.strip()

    def output(self, job):
        path = self.directory / f"{job}.out"
        return path.read_text() if path.exists() else ""

    def wait_for_output(self, job, text):
        def is_there():
            output = self.output(job)
            check(text in output or "campaign.sbatch: error:" not in output, output)
            return text in output

        wait_until(f"'{text}' of job {job}", is_there)

    def wait_for_end(self, job):
        state = ["squeue", "--noheader", "--jobs", job, "--format", "%T"]
        wait_until(f"the end of job {job}", lambda: not self.answer(*state).stdout.strip())

    def num_stored(self):
        """Runs in the database of the coordinator that works."""
        for database in self.directory.glob("scratch/proofmass-*/*.db"):
            query = "SELECT count(*) FROM run_result"
            process = self.answer("proofmass", "query", "--format", "csv", database, query)
            if process.returncode == 0:
                return int(process.stdout.split()[-1])
        return 0

    def wait_for_runs(self, count):
        wait_until(f"{count} runs", lambda: self.num_stored() >= count)

    @contextlib.contextmanager
    def started(self, log, *command):
        """A program beside the cluster, which is killed if it does not end before."""
        with open(self.directory / log, "w") as errors:
            process = subprocess.Popen(
                command, cwd=self.directory, env=self.environment, stderr=errors
            )
            try:
                yield process
            finally:
                process.kill()
                process.wait()

    def kill_coordinator(self):
        for process in self.cluster.processes_of():
            if told_of(process, "comm").startswith(b"proofmass-coord"):
                kill(process)


def run_undisturbed(site, expected):
    job = site.submit("--nodes=3", site.script, "short.toml", "undisturbed")
    site.wait_for_output(job, "campaign.sbatch: finished")
    site.wait_for_end(job)
    check(site.digest("undisturbed/hardy2013.db") == expected, "another digest")
    workers = site.proofmass(
        *("query", "--format", "csv", "undisturbed/hardy2013.db", "SELECT count(*) FROM worker")
    )
    check(workers.split()[-1] == str(NUM_NODES), f"{workers} (must be a worker on each node)")
    for path in (site.directory / "undisturbed/keys").glob("*.key"):
        check(path.stat().st_mode & 0o777 == 0o600, f"{path} can be read by others")
    check(not list((site.directory / "scratch").iterdir()), "something stays on the local disk")


def run_with_failures(site, expected):
    job = site.submit("--nodes=3", site.script, "short.toml", "failures")
    site.wait_for_runs(100)
    site.cluster.kill_node("n3")
    site.wait_for_runs(400)
    site.cluster.kill_controller(job)
    site.wait_for_runs(700)
    site.cluster.start_controller()
    site.kill_coordinator()
    site.wait_for_output(job, "the coordinator ended with 137; it is started again")
    site.wait_for_output(job, "campaign.sbatch: finished")
    check(site.digest("failures/hardy2013.db") == expected, "another digest after failures")
    site.cluster.start_node("n3")
    site.wait_for_end(job)


def run_in_three_jobs(site, expected):
    arguments = ("--nodes=2", site.script, "short.toml", "resumed")
    job = site.submit(*arguments)
    site.wait_for_runs(100)
    site.cluster.run("scancel", "--batch", "--signal=TERM", job)
    site.wait_for_output(job, "not finished; the same command goes on")
    site.wait_for_end(job)

    # Workers leave in time before this, and with the last of them the job ends.
    job = site.submit(*arguments, SLURM_JOB_END_TIME=str(int(time.time()) + 12))
    site.wait_for_output(job, "not finished; the same command goes on")
    site.wait_for_end(job)

    job = site.submit(*arguments)
    site.wait_for_output(job, "campaign.sbatch: finished")
    site.wait_for_end(job)
    check(site.digest("resumed/hardy2013.db") == expected, "another digest after three jobs")
    # What workers gave back at the end of the second job is no loss.
    lost = "SELECT count(*) FROM attempt WHERE reason <> 'walltime'"
    lost = site.proofmass("query", "--format", "csv", "resumed/hardy2013.db", lost).split()[-1]
    check(lost == "0", f"{lost} leases were lost (must be 0)")


def run_by_factory(site, expected):
    port = free_ports(2)
    clients = ("--connect", f"tcp://127.0.0.1:{port + 1}")
    (site.directory / "served").mkdir()
    coordinator = (
        *("proofmass-coordinator", "--directory", "served", "short.toml"),
        *("--bind", f"tcp://127.0.0.1:{port}", "--bind-clients", clients[1]),
    )
    factory = (
        *("proofmass", "factory", "--batch-system", "slurm", "--name", "fleet", *clients),
        *("--worker-connect", f"tcp://127.0.0.1:{port}", "--processors", "1", "--interval", "1"),
        *("--walltime", "20", "--utilisation-min", "0.001", "--idle-timeout", "5"),
        *("--workers-max", str(NUM_NODES), "--backlog", str(NUM_NODES), "--exit-when-done"),
        "--submit-option=--output=%j.out",
    )

    def num_done():
        process = site.answer("proofmass", "status", "--json", *clients)
        return json.loads(process.stdout)["campaigns"][0]["num_done"] if process.stdout else 0

    def jobs(state):
        listing = ("squeue", "--noheader", f"--states={state}", "--format=%j %i %N")
        lines = [line.split() for line in site.answer(*listing).stdout.splitlines()]
        return [line[1:] for line in lines if line[0].startswith("fleet-")]

    with (
        site.started("served.log", *coordinator) as service,
        site.started("factory.log", *factory) as keeper,
    ):
        wait_until("the first worker's runs", lambda: num_done() > 0)
        wait_until("three workers", lambda: len(jobs("RUNNING")) == NUM_NODES)
        job, node = jobs("RUNNING")[-1]
        site.cluster.kill_node(node)
        wait_until("runs after the loss of a node", lambda: num_done() >= 1000)
        job = next(running for running, other in jobs("RUNNING") if other != node)
        site.cluster.run("scontrol", "requeue", job)
        wait_until("the end of the factory", lambda: keeper.poll() is not None)
        check(keeper.returncode == 0, (site.directory / "factory.log").read_text())
        site.cluster.start_node(node)
        wait_until("the end of the workers", lambda: not jobs("PENDING,RUNNING,COMPLETING"))
        service.terminate()
        check(service.wait() == 0, "the coordinator does not end in order")
    check(site.digest("served/hardy2013.db") == expected, "another digest by the factory")


def refuse(site, _):
    (site.directory / "wrong.toml").write_text("[campaign]\nname = 3\n")
    job = site.submit("--nodes=1", site.script, "wrong.toml")
    site.wait_for_end(job)
    check("error: wrong.toml" in site.output(job), site.output(job))

    other = site.submit("--nodes=1", "--wrap", "sleep 100")
    (site.directory / "taken").mkdir()
    (site.directory / "taken/job").write_text(f"{other}\n")
    running = ["squeue", "--noheader", "--jobs", other, "--states", "running"]
    wait_until("the other job", lambda: site.answer(*running).stdout)
    job = site.submit("--nodes=1", site.script, "short.toml", "taken")
    site.wait_for_end(job)
    check(f"DIRECTORY = taken (job {other} computes into it)" in site.output(job), site.output(job))
    site.cluster.run("scancel", other)


def main():
    arguments = checking.parser_of(__doc__).parse_args()
    needed = ("slurmctld", "slurmd", "munged", "sbatch")
    if os.geteuid() != 0 or not all(shutil.which(name) for name in needed):
        checking.skip(f"needs root and {', '.join(needed)}")
    with tempfile.TemporaryDirectory() as name:
        cluster = Cluster(Path(name) / "cluster")
        try:
            with checking.failure_told(lambda: Path(name).glob("site/*/*.log")):
                cluster.start()
                site = Site(cluster, Path(name) / "site", arguments.programs.resolve())
                expected = site.reference()
                scenarios = (run_undisturbed, run_with_failures, run_in_three_jobs, run_by_factory, refuse)
                for scenario in scenarios:
                    begin = time.monotonic()
                    scenario(site, expected)
                    print(f"{scenario.__name__}: {time.monotonic() - begin:.1f} s", flush=True)
        finally:
            cluster.stop()


if __name__ == "__main__":
    main()
