#!/usr/bin/env python3
"""Batch systems for tests: commands of OpenPBS and HTCondor, and a queue that runs what they take.

A command is a link to this file by its name: qsub, qselect, qdel, condor_submit, condor_q,
condor_rm. They answer as the real ones do: what they print where, exit codes, identifiers. The
queue is the directory BATCH_DIRECTORY, in which an allocation is a directory of its number:

    name, owner, state   files; the state is a letter of PBS, also for HTCondor
    script               what PBS starts
    description          what HTCondor starts, as JSON
    deleted              is there once somebody has asked for its end

Whoever reads or writes them has locked the directory. Only the Queue, in the process of a test,
changes states and starts processes. The test brings trouble about by files in `trouble`:
refused-NAME has the number of submissions of that name that are refused as by a full queue; while
`down` is there, no command reaches the server; `kept` has the number of an allocation that cannot
be deleted.
"""

import contextlib
import fcntl
import getpass
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

# A command's last line on standard error, and its exit code.
PBS_DOWN = "{}: cannot connect to server head (errno=111)", 111
PBS_FULL = "qsub: Maximum number of jobs already in queue", 15046 % 256
PBS_UNKNOWN = "qdel: Unknown Job Id {}", 15001 % 256
PBS_KEPT = "qdel: Unauthorized Request  {}", 15007 % 256
CONDOR_DOWN = "SECMAN:2007:Failed to end classad message.", 1
CONDOR_FULL = "Number of submitted jobs would exceed MAX_JOBS_SUBMITTED", 1
CONDOR_UNKNOWN = "Job {} not found", 1
CONDOR_KEPT = "Permission denied to remove job {}", 1

# JobStatus of HTCondor for a state of PBS.
CONDOR_STATES = {"Q": 1, "R": 2, "E": 3, "H": 5}


class Allocation:
    """A directory of the queue."""

    def __init__(self, path):
        self.path = path
        self.number = int(path.name)

    def read(self, file):
        return (self.path / file).read_text()

    def write(self, file, text):
        (self.path / file).write_text(text)

    @property
    def state(self):
        return self.read("state")


@contextlib.contextmanager
def locked(directory):
    with open(directory / "lock", "w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        yield


def allocations(directory):
    found = [Allocation(path) for path in (directory / "queue").iterdir()]
    return sorted(found, key=lambda allocation: allocation.number)


def add(directory, **files):
    """Puts an allocation into the queue; its number."""
    last = directory / "last-number"
    number = int(last.read_text()) + 1 if last.exists() else 1
    last.write_text(str(number))
    path = directory / "queue" / str(number)
    path.mkdir()
    for file, text in {"owner": getpass.getuser(), "state": "Q", **files}.items():
        (path / file).write_text(text)
    return number


def fail(answer, *names):
    text, code = answer
    print(text.format(*names), file=sys.stderr)
    sys.exit(code)


def take_refusal(directory, name):
    """True if the queue is full for this submission."""
    file = directory / f"trouble/refused-{name}"
    count = int(file.read_text()) if file.exists() else 0
    if count > 0:
        file.write_text(str(count - 1))
    return count > 0


def is_kept(directory, number):
    file = directory / "trouble/kept"
    return file.exists() and int(file.read_text()) == number


def delete(directory, number, identifier, unknown, kept):
    found = [item for item in allocations(directory) if item.number == number]
    if not found:
        fail(unknown, identifier)
    if is_kept(directory, number):
        fail(kept, identifier)
    found[0].write("deleted", "")


# OpenPBS.


def options_of(arguments, allowed, usage):
    """Pairs of option and value, as getopt() has them; nothing else may follow."""
    pairs = []
    while arguments:
        if len(arguments) < 2 or arguments[0] not in allowed:
            fail((usage, 2))
        pairs.append((arguments[0], arguments[1]))
        arguments = arguments[2:]
    return pairs


def qsub(directory, arguments):
    options = options_of(arguments, ("-N", "-l"), "usage: qsub [-l resource_list] [-N name]")
    name = dict(options).get("-N", "STDIN")
    for option, value in options:
        if option == "-l" and not re.fullmatch(
            r"walltime=\d+(:\d\d){0,2}|select=\d+(:ncpus=\d+)?|place=excl", value
        ):
            fail(("qsub: Illegal attribute or resource value", 15014 % 256))
    if take_refusal(directory, name):
        fail(PBS_FULL)
    print(f"{add(directory, name=name, script=sys.stdin.read())}.head")


def qselect(directory, arguments):
    allowed = ("-u", "-N", "-s")
    options = dict(options_of(arguments, allowed, "usage: qselect [-N name] [-s states] [-u user]"))
    states = options.get("-s", "BEFHMQRSTUWX")
    if not set(states) <= set("BEFHMQRSTUWX"):
        fail(("qselect: illegal -s value", 2))
    for allocation in allocations(directory):
        wanted = {"-u": allocation.read("owner"), "-N": allocation.read("name")}
        if allocation.state in states and all(
            options.get(option, value) == value for option, value in wanted.items()
        ):
            print(f"{allocation.number}.head")


def qdel(directory, arguments):
    match = re.fullmatch(r"(\d+)\.head", arguments[0])
    if not match:
        fail(("qdel: illegally formed job identifier: {}", 1), arguments[0])
    delete(directory, int(match[1]), arguments[0], PBS_UNKNOWN, PBS_KEPT)


# HTCondor.


def words_of_arguments(text):
    """The new syntax: double quotes around all, single quotes around words, each doubled within."""
    assert text[0] == text[-1] == '"', text
    text = text[1:-1].replace('""', '"')
    words, word, is_quoted, i = [], None, False, 0
    while i < len(text):
        character = text[i]
        if character == "'":
            if is_quoted and text[i + 1 : i + 2] == "'":
                word += "'"
                i += 1
            else:
                is_quoted = not is_quoted
                word = word or ""
        elif character == " " and not is_quoted:
            words.append(word)
            word = None
        else:
            word = (word or "") + character
        i += 1
    return [word for word in words + [word] if word is not None]


def expanded(argument, number):
    """What becomes of macros: all that is unknown is empty."""
    known = {"ClusterId": str(number), "ProcId": "0", "DOLLAR": "$"}
    argument = re.sub(r"(?<!\$)\$\((\w+)[^)]*\)", lambda m: known.get(m[1], ""), argument)
    return argument.replace("$$(DOLLARDOLLAR)", "$$")


def condor_submit(directory, arguments):
    assert arguments == ["-terse", "-"], arguments
    lines = sys.stdin.read().splitlines()
    assert lines.pop() == "queue", lines
    description = dict(line.split(" = ", 1) for line in lines)
    if take_refusal(directory, description["batch_name"]):
        print("\nERROR: Failed to create cluster", file=sys.stderr)
        fail(CONDOR_FULL)
    if description.pop("getenv", "false") == "true":
        description["environment"] = without_preloaded_clock(os.environ)
    number = add(directory, name=description["batch_name"], description=json.dumps(description))
    print(f"{number}.0 - {number}.0")


def without_preloaded_clock(environment):
    """The clock of a test goes faster for the command that it looks at, and for nothing else."""
    return {
        name: value
        for name, value in environment.items()
        if name != "LD_PRELOAD" and not name.startswith("FAKETIME")
    }


def condor_q(directory, arguments):
    assert arguments[0] == "-constraint", arguments
    constraint = arguments[1].replace("&&", " and ").replace("||", " or ")
    formats = arguments[2:]
    for allocation in allocations(directory):
        attributes = {
            "JobBatchName": allocation.read("name"),
            "JobStatus": CONDOR_STATES[allocation.state],
            "ClusterId": allocation.number,
            "ProcId": 0,
        }
        if not eval(constraint, {}, attributes):
            continue
        for option, form, attribute in zip(*[iter(formats)] * 3):
            assert option == "-format", option
            print(form % attributes[attribute], end="")


def condor_rm(directory, arguments):
    number = int(re.fullmatch(r"(\d+)\.0", arguments[0])[1])
    delete(directory, number, arguments[0], CONDOR_UNKNOWN, CONDOR_KEPT)
    print(f"Job {arguments[0]} marked for removal")


# The server.


class Queue:
    """Starts and ends what is submitted to a directory. It lives as long as the queue."""

    wait_s = 0.2  # Until an allocation gets a node.
    kill_delay_s = 2.0  # Between SIGTERM and SIGKILL.

    def __init__(self, directory, system, programs):
        self.directory = directory
        self.system = system
        self.programs = programs
        for name in ("queue", "trouble", "commands", "output"):
            (directory / name).mkdir(parents=True)
        for name in COMMANDS[system]:
            (directory / "commands" / name).symlink_to(Path(__file__).resolve())
        self.environment = {
            **os.environ,
            "PATH": f"{directory / 'commands'}:{os.environ['PATH']}",
            "BATCH_DIRECTORY": str(directory),
        }
        self.held = set()  # Numbers that never start.
        self.waiting = set()  # Names whose allocations do not start for now.
        self.processes = {}
        self.seen = {}  # When a number was seen first.
        self.end = {}  # When a process is killed.

    def turn(self):
        """To be called some times a second."""
        with locked(self.directory):
            for allocation in allocations(self.directory):
                self.advance(allocation)

    def advance(self, allocation):
        if (allocation.path / "deleted").exists() and allocation.state != "E":
            self.terminate(allocation)
        elif allocation.state in "RE":
            self.look_at(allocation)
        elif allocation.number in self.held:
            allocation.write("state", "H")
        elif self.has_waited(allocation):
            self.start(allocation)

    def has_waited(self, allocation):
        begin = self.seen.setdefault(allocation.number, time.monotonic())
        is_due = time.monotonic() - begin > self.wait_s
        return is_due and allocation.read("name") not in self.waiting

    def start(self, allocation):
        start = self.start_by_pbs if self.system == "pbs" else self.start_by_condor
        self.processes[allocation.number] = start(allocation)
        allocation.write("state", "R")

    def popen(self, allocation, command, **options):
        with open(self.directory / f"output/{allocation.number}", "w") as output:
            # Commands come before what computes.
            command = ["nice", *command]
            return subprocess.Popen(
                command, stdout=output, stderr=output, start_new_session=True, **options
            )

    def start_by_pbs(self, allocation):
        """A shell reads the path of the script. Little of the environment comes with it."""
        (allocation.path / "script").chmod(0o700)
        environment = {name: os.environ[name] for name in ("HOME", "USER") if name in os.environ}
        environment |= {
            "PATH": f"{self.programs}:{os.environ['PATH']}",
            "PBS_ENVIRONMENT": "PBS_BATCH",
            "PBS_JOBID": f"{allocation.number}.head",
        }
        process = self.popen(
            allocation, ["/bin/sh"], stdin=subprocess.PIPE, env=environment, text=True
        )
        process.stdin.write(f"{allocation.path / 'script'}\n")
        process.stdin.close()
        return process

    def start_by_condor(self, allocation):
        description = json.loads(allocation.read("description"))
        arguments = words_of_arguments(description["arguments"])
        arguments = [expanded(argument, allocation.number) for argument in arguments]
        return self.popen(
            allocation,
            [description["executable"], *arguments],
            stdin=subprocess.DEVNULL,
            env=description.get("environment", {"PATH": os.environ["PATH"]}),
        )

    def look_at(self, allocation):
        """It is over when the last process of its session is."""
        number = allocation.number
        self.processes[number].poll()
        if time.monotonic() > self.end.get(number, float("inf")):
            self.signal(number, signal.SIGKILL)
        if not self.signal(number, 0):
            shutil.rmtree(allocation.path)

    def preempt(self, number):
        """Something more important needs the node."""
        with locked(self.directory):
            (self.directory / "queue" / str(number) / "deleted").touch()

    def terminate(self, allocation):
        if allocation.state != "R":
            shutil.rmtree(allocation.path)
            return
        self.signal(allocation.number, signal.SIGTERM)
        self.end[allocation.number] = time.monotonic() + self.kill_delay_s
        allocation.write("state", "E")

    def signal(self, number, which):
        """False if no process is left."""
        try:
            os.killpg(self.processes[number].pid, which)
            return True
        except ProcessLookupError:
            return False

    def close(self):
        for number, process in self.processes.items():
            self.signal(number, signal.SIGKILL)
            process.wait()


COMMANDS = {
    "pbs": {"qsub": qsub, "qselect": qselect, "qdel": qdel},
    "condor": {"condor_submit": condor_submit, "condor_q": condor_q, "condor_rm": condor_rm},
}


def main():
    name = Path(sys.argv[0]).name
    directory = Path(os.environ["BATCH_DIRECTORY"])
    system = next(system for system, commands in COMMANDS.items() if name in commands)
    if (directory / "trouble/down").exists():
        if system == "condor":
            print("\n-- Failed to fetch ads from: <127.0.0.1:9618> : head", file=sys.stderr)
        fail(PBS_DOWN if system == "pbs" else CONDOR_DOWN, name)
    with locked(directory):
        COMMANDS[system][name](directory, sys.argv[1:])


if __name__ == "__main__":
    main()
