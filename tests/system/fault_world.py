"""A coordinator, workers and clients: real processes in one directory, whose surroundings fail."""

import contextlib
import ctypes
import errno
import json
import mmap
import os
import random
import re
import shutil
import signal
import sqlite3
import struct
import subprocess
import time

from checking import free_port

TIME_SCALE = 0.05  # A worker counts as lost after 3 s.
CLIENT_TIMEOUT_S = 5
# Numbers of runs of each campaign, at first and extended; the first two have made-up results.
SIZES = {"alpha": [1200, 1800, 2400], "beta": [600, 900], "gamma": [32, 48, 64],
         "delta": [16, 32]}
END_TIMEOUT_S = 60.0  # A program that was asked to end has ended by then.
RESTART_DELAY_S = 0.3
DISK_SIZE = "24m"
# Whatever a program says when it breaks a rule of its own.
ABORT_MARKS = re.compile(r"terminate called|Assertion|Sanitizer"
                         r"|internal invariant broken|stack smashing|double free|Segmentation fault")
# What a worker with made-up results cannot pass: its runs are not those of the model.
FAILS_OF_NULL_RUNS = {"simulation", "draws", "truths"}

CALLS = {"open": 1, "write": 2, "sync": 4, "rename": 8, "truncate": 16, "map": 32, "link": 64,
         "unlink": 128}
ORDERS_SIZE = 52


class Failure(Exception):
    """What must never happen has happened."""


class Orders:
    """Which system calls fail, read by the preloaded library (faulty_calls.cpp)."""

    def __init__(self, file):
        self.file = file
        file.write_bytes(bytes(ORDERS_SIZE))
        with open(file, "r+b") as stream:
            self.memory = mmap.mmap(stream.fileno(), ORDERS_SIZE)

    def set(self, calls, error, first=1, last=0xFFFFFFFF):
        mask = sum(CALLS[name] for name in calls)
        # The mask goes last: with it the order is valid.
        self.memory[4:20] = struct.pack("=4I", error, first, last, 0)
        self.memory[0:4] = struct.pack("=I", mask)

    def clear(self):
        self.memory[0:4] = bytes(4)

    def tally(self):
        """How many calls of each kind there were."""
        return dict(zip(CALLS, struct.unpack("=8I", self.memory[20:ORDERS_SIZE])))


class Program:
    """A process, its log, and whether its end is expected."""

    def __init__(self, world, name, command, environment=None):
        self.name = name
        self.log = world.directory / f"{name}.err"
        self.is_end_expected = False
        self.is_stopped = False
        self.is_faulty = False  # It was told to lose messages or to die somewhere.
        with open(self.log, "ab") as errors:
            self.process = subprocess.Popen(
                [str(word) for word in command], cwd=world.directory, stdin=subprocess.DEVNULL,
                stdout=errors, stderr=errors, start_new_session=True,
                env={**os.environ, "TMPDIR": str(world.directory), **(environment or {})})

    def has_ended(self):
        return self.process.poll() is not None

    def signal(self, number):
        if not self.has_ended():
            self.process.send_signal(number)

    def kill(self):
        """Ends it with all processes that it has started."""
        self.is_end_expected = True
        with contextlib.suppress(ProcessLookupError):
            os.killpg(self.process.pid, signal.SIGKILL)
        self.process.wait()

    def wait(self, timeout_s=END_TIMEOUT_S):
        try:
            return self.process.wait(timeout_s)
        except subprocess.TimeoutExpired:
            raise Failure(f"{self.name} did not end within {timeout_s:g} s") from None

    def text(self):
        return self.log.read_text(errors="replace") if self.log.exists() else ""


class Campaign:
    """What one campaign should become and what was seen of it."""

    def __init__(self, name, sizes):
        self.name = name
        self.sizes = sizes
        self.num_runs = sizes[0]  # Wanted at present.
        self.is_busy = False  # Something is being done to its file.
        self.is_paused = False
        self.refusal = ""  # What the last submission was answered with.
        self.seen = {}  # Time of receipt of each run that was in its file some time.

    def next_size(self):
        return next((size for size in self.sizes if size > self.num_runs), None)


def mount_disk(folder, size=DISK_SIZE):
    """A file system of its own; the process has mounts of its own."""
    libc = ctypes.CDLL(None, use_errno=True)
    if libc.mount(b"tmpfs", str(folder).encode(), b"tmpfs", 0, f"size={size}".encode()) != 0:
        raise OSError(ctypes.get_errno(), "cannot mount a file system (root is needed)")


class Setting:
    """What a seed decides before anything starts."""

    def __init__(self, seed):
        self.random = random.Random(seed)
        self.draw_setting()

    def draw_setting(self):
        draw = self.random
        self.is_null = draw.random() < 0.8
        if self.is_null:
            names = ["alpha", "beta"]
        else:
            names = ["gamma", "delta"]
        names = names if draw.random() < 0.4 else names[:1]
        self.campaigns = [Campaign(name, SIZES[name]) for name in names]
        self.num_workers = draw.randint(2, 4) if self.is_null else 2
        self.length_s = draw.uniform(4.0, 8.0)
        num_batches = sum(campaign.sizes[0] for campaign in self.campaigns) / 16
        self.run_time_s = min(0.5, 0.9 * self.length_s * self.num_workers / num_batches)
        self.has_keys = draw.random() < 0.35
        self.has_spool = draw.random() < 0.5
        self.is_tcp = draw.random() < 0.4
        self.plans = self.draw_plans()

    def draw_plans(self):
        """What goes wrong between the sockets, and where processes die."""
        draw = self.random
        plans = {}
        if draw.random() < 0.4:
            side = draw.choice(["coordinator", "worker", "both"])
            parts = [f"seed={draw.randrange(1000)}"]
            if draw.random() < 0.6:
                parts.append(f"drop={draw.uniform(0.01, 0.15):.3f}")
            if draw.random() < 0.5:
                parts.append(f"delay={draw.uniform(0.05, 0.5):.3f}:{draw.uniform(0.05, 1.0):.3f}")
            if draw.random() < 0.5:
                parts.append(f"duplicate={draw.uniform(0.05, 0.4):.3f}")
            if draw.random() < 0.5:
                parts.append(f"reorder={draw.uniform(0.05, 0.4):.3f}")
            if draw.random() < 0.4:
                parts.append(f"cut=0.01:{draw.uniform(0.5, 5.0):.3f}")
            for name in ("coordinator", "worker"):
                if side in (name, "both"):
                    plans[name] = ",".join(parts)
        if draw.random() < 0.3:
            point = draw.choice(["after_receive", "before_commit", "after_commit",
                                 "after_acknowledge", "after_lend", "after_open"])
            plans["coordinator_kill"] = f"kill={point}:{draw.randint(1, 8)}"
        if draw.random() < 0.2:
            point = draw.choice(["after_lease", "before_result", "after_result"])
            plans["worker_kill"] = f"kill={point}:{draw.randint(1, 8)}"
        return plans

    def setting(self):
        words = ["null" if self.is_null else "simulated", f"{self.num_workers} workers",
                 " ".join(campaign.name for campaign in self.campaigns),
                 "tcp" if self.is_tcp else "ipc"]
        words += ["keys"] if self.has_keys else []
        words += ["spool"] if self.has_spool else []
        return ", ".join(words + [f"{name} {plan}" for name, plan in self.plans.items()])


class World(Setting):
    """Everything that one schedule starts."""

    def __init__(self, options, seed, directory):
        super().__init__(seed)
        self.options = options
        self.programs = options.programs.resolve()
        self.directory = directory
        self.served = directory / "served"
        self.backups = directory / "backups"
        self.served.mkdir(parents=True)
        self.backups.mkdir()
        mount_disk(self.served)
        self.orders = Orders(directory / "orders")
        self.num_active = 0  # Faults under way.
        self.quiet_since = time.monotonic()
        self.counts = {"coordinator starts": 0, "refused starts": 0, "worker starts": 0,
                       "runs computed again": 0, "resubmissions": 0}
        self.workers = []
        self.ended_workers = []
        self.coordinator = None
        self.restart_at = None
        self.story = open(directory / "story", "w")
        self.start_time = time.monotonic()
        self.prepare()

    def prepare(self):
        """What the setting needs in the directory."""
        for campaign in self.campaigns:
            shutil.copy(self.options.reference / f"{campaign.name}.toml", self.directory)
        if self.is_tcp:
            self.endpoints = [f"tcp://127.0.0.1:{free_port()}" for _ in range(2)]
        else:
            self.endpoints = [f"ipc://{self.directory}/{door}" for door in ("workers", "clients")]
        if self.has_keys:
            self.run("keygen", "keys")

    def tell(self, text):
        print(f"{time.monotonic() - self.start_time:7.2f} {text}", file=self.story, flush=True)

    # Programs.

    def keys(self):
        return ["--keys", "keys"] if self.has_keys else []

    def run(self, *arguments):
        """A command of `proofmass`: its exit code and what it wrote."""
        done = subprocess.run([self.programs / "proofmass", *map(str, arguments)], text=True,
                              cwd=self.directory, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                              timeout=120, check=False, errors="replace")
        if done.returncode < 0 or ABORT_MARKS.search(done.stderr):
            raise Failure(f"proofmass {' '.join(map(str, arguments))} ended with "
                          f"{done.returncode}: {done.stderr.strip()[-500:]}")
        return done

    def ask(self, *arguments):
        """A command to the coordinator."""
        return self.run(*arguments, "--connect", self.endpoints[1], "--timeout", CLIENT_TIMEOUT_S,
                        *self.keys())

    def submit(self, campaign):
        done = self.ask("submit", f"{campaign.name}.toml", "--runs", campaign.num_runs)
        campaign.refusal = done.stderr.strip()
        self.tell(f"submit {campaign.name} {campaign.num_runs}: {done.returncode} "
                  f"{campaign.refusal}")
        return done.returncode == 0

    def start_coordinator(self, is_faulty=True):
        if self.coordinator is not None and not self.coordinator.has_ended():
            return
        plans = [self.plans[name] for name in ("coordinator", "coordinator_kill")
                 if name in self.plans] if is_faulty else []
        self.plans.pop("coordinator_kill", None)  # Once is enough.
        number = self.counts["coordinator starts"]
        self.counts["coordinator starts"] += 1
        self.coordinator = Program(
            self, f"coordinator-{number}",
            [self.programs / ("proofmass-coordinator" + ("-with-faults" if plans else "")),
             "--directory", "served", "--bind",
             self.endpoints[0], "--bind-clients", self.endpoints[1], "--time-scale", TIME_SCALE,
             "--drain-time", 3, *self.keys(), *(["--faults", ",".join(plans)] if plans else [])],
            {"LD_PRELOAD": str(self.options.faulty_calls),
             "PROOFMASS_FAULTY_DIRECTORY": str(self.served),
             "PROOFMASS_FAULTY_ORDERS": str(self.orders.file)})
        self.coordinator.is_faulty = bool(plans)
        self.restart_at = None
        self.tell(f"coordinator-{number} starts")

    def start_worker(self, slot, is_faulty=True):
        plans = [self.plans[name] for name in ("worker", "worker_kill")
                 if name in self.plans] if is_faulty else []
        self.plans.pop("worker_kill", None)
        number = self.counts["worker starts"]
        self.counts["worker starts"] += 1
        program = "proofmass-null-worker" if self.is_null else "proofmass-worker"
        if plans and not self.is_null:
            program += "-with-faults"
        command = [self.programs / program, "--connect", self.endpoints[0], "--threads", 1,
                   "--name", f"w{number}", "--drain-time", 4, *self.keys()]
        command += ["--run-time", f"{self.run_time_s:.3f}"] if self.is_null else []
        command += ["--spool", f"spool-{slot}"] if self.has_spool else []
        command += ["--faults", ",".join(plans)] if plans else []
        worker = Program(self, f"worker-{number}", command)
        worker.slot = slot
        worker.is_faulty = bool(plans)
        worker.kills_itself = any(plan.startswith("kill=") for plan in plans)
        self.workers.append(worker)
        self.tell(f"worker-{number} starts")

    def replace_worker(self, worker, is_faulty=True):
        self.workers.remove(worker)
        self.ended_workers.append(worker)
        self.start_worker(worker.slot, is_faulty)

    def watch(self):
        """Starts what has ended, as an init system would, unless it must not have ended."""
        now = time.monotonic()
        is_quiet = self.num_active == 0 and now - self.quiet_since > 1.0
        if self.coordinator.has_ended() and self.restart_at is None:
            code = self.coordinator.process.returncode
            if not self.coordinator.is_end_expected:
                if code == -signal.SIGKILL and self.coordinator.is_faulty:
                    self.tell(f"{self.coordinator.name} died where it was told to")
                elif code == 1 and not is_quiet:
                    self.counts["refused starts"] += 1
                    self.tell(f"{self.coordinator.name} ended with 1")
                else:
                    raise Failure(f"{self.coordinator.name} ended with {code}")
                self.restart_at = now + RESTART_DELAY_S
        if self.restart_at is not None and now >= self.restart_at:
            self.start_coordinator()
        for worker in list(self.workers):
            if worker.has_ended() and not worker.is_end_expected:
                self.check_worker_end(worker)
                self.replace_worker(worker)

    def check_worker_end(self, worker):
        code = worker.process.returncode
        self.tell(f"{worker.name} ended with {code}")
        # One that is asked to end may still come to the place where it was told to die.
        died_as_told = worker.kills_itself and code == 128 + signal.SIGKILL
        # A signal within milliseconds of the start meets a program that catches none yet.
        had_not_begun = code == -signal.SIGTERM and not worker.text()
        if code != 0 and not died_as_told and not had_not_begun:
            raise Failure(f"{worker.name}, which is honest, ended with {code}: "
                          f"{worker.text().strip().splitlines()[-1:]}")

    # Files.

    def file_of(self, campaign):
        return self.served / f"{campaign.name}.db"

    def rows(self, campaign):
        return self.rows_in(self.file_of(campaign))

    def rows_in(self, file):
        """Time of receipt of each stored run; nothing if the file cannot be read now."""
        try:
            connection = sqlite3.connect(f"file:{file}?mode=ro", uri=True, timeout=0.2)
            try:
                return dict(connection.execute(
                    "SELECT r.run_index, d.received_unix_s FROM run_result AS r "
                    "JOIN delivery AS d USING (run_index)"))
            finally:
                connection.close()
        except sqlite3.Error:
            return None

    def look(self, campaign):
        """Remembers what is stored."""
        if not file_is_there(self.file_of(campaign)):
            return
        for run, when in (self.rows(campaign) or {}).items():
            campaign.seen.setdefault(run, when)

    def fill_disk(self):
        with contextlib.suppress(OSError), open(self.served / "ballast", "ab") as ballast:
            while True:
                ballast.write(bytes(1 << 12))
                ballast.flush()

    def free_disk(self):
        with contextlib.suppress(FileNotFoundError):
            (self.served / "ballast").unlink()

    def status(self):
        """The campaigns of the coordinator by name; nothing while it does not answer."""
        done = self.ask("status", "--json")
        if done.returncode != 0:
            return None
        return {one["name"]: one for one in json.loads(done.stdout)["campaigns"]}

    def close(self):
        for program in [*self.workers, *self.ended_workers, self.coordinator]:
            if program is not None:
                program.kill()
        self.story.close()


def verified_digest(programs, file, is_null):
    """What `proofmass verify` finds the digest to be; it must find nothing wrong."""
    done = subprocess.run([programs / "proofmass", "verify", file, "--fraction", "0"], text=True,
                          check=False, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    fails = set(re.findall(r"(?m)^(\w+) +FAILS", done.stdout))
    if done.returncode != 0 and not (is_null and fails and fails <= FAILS_OF_NULL_RUNS):
        raise Failure(f"verify {file.name}: {done.stdout}{done.stderr}")
    found = re.search(r"(?m)^digest +ok .*\n +([0-9a-f]{64})$", done.stdout)
    if not found:
        raise Failure(f"verify {file.name} shows no digest: {done.stdout}{done.stderr}")
    return found.group(1)


def file_is_there(path):
    try:
        return path.is_file() and path.stat().st_size > 0
    except OSError as error:
        if error.errno in (errno.ENOENT, errno.EIO):
            return False
        raise
