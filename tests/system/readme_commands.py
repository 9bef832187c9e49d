#!/usr/bin/env python3
"""Runs the commands of the top-level README.md as typed and compares the output that it shows.

Indented lines are commands. They run in their order; the coordinator and the worker stay until the
end. Then come the commands after `$ ` in the fenced blocks, whose whole output must be what the
block shows; a line `...` there stands for any lines. Pictures are compared with what `plot` draws.

Everything but ./deploy/quickstart.sh runs in a network namespace in which coordinator.example is
this machine, and therefore needs root. Two things are not as typed: the sessions of mine.toml are
shortened, so that its runs take milliseconds, and with --programs the quick start only runs its
last line, the campaign. With --root, a root directory with a bare Debian 12 made by mmdebstrap,
into which a clone was copied at --clone, everything is done there, installing and building
included.

Exit code 0 if all is as the README says, 1 if not; 77 if a namespace cannot be made, but 1 if the
environment has CI.
"""

import argparse
import os
import re
import shutil
import subprocess
import sys
import tempfile
import time

import checking

SERVICES = ("proofmass-coordinator ", "proofmass-worker ")
# Plans need sessions of two orbits, and runs need not.
SHORTENED_AFTER = "proofmass plan mine.toml"
SHORT_CAMPAIGN = f"sed -i -E '{checking.shortening(runs=100)}' mine.toml"
QUICK_START = "./deploy/quickstart.sh"
WORDS_MAX = 1500


class Mismatch(Exception):
    """What the README promises and does not hold."""


class Machine:
    """Where commands run: here or below another root, with a network of their own."""

    def __init__(self, root, directory):
        self._directory = directory
        self._exports = []
        self._change_root = ["chroot", root] if root else []
        self._holder = subprocess.Popen(["unshare", "--net", "--mount", "sleep", "infinity"])
        self._namespaces = ["nsenter", "--target", str(self._holder.pid), "--net", "--mount"]
        self._wait_for_namespaces()
        subprocess.run([*self._namespaces, "ip", "link", "set", "lo", "up"], check=True)
        with tempfile.NamedTemporaryFile("w", suffix=".hosts") as hosts:
            hosts.write("127.0.0.1 localhost coordinator.example\n")
            hosts.flush()
            names = f"{root or ''}/etc/hosts"
            subprocess.run([*self._namespaces, "mount", "--bind", hosts.name, names], check=True)

    def _wait_for_namespaces(self):
        ours = os.readlink("/proc/self/ns/mnt")  # Made last.
        while self._holder.poll() is None:
            if os.readlink(f"/proc/{self._holder.pid}/ns/mnt") != ours:
                return
            time.sleep(0.01)
        checking.skip("a network namespace cannot be made")

    def export(self, line):
        self._exports.append(line)

    def start(self, command, *, is_outside=False, **options):
        lines = "\n".join(["set -e", f"cd '{self._directory}'", *self._exports, command])
        namespaces = [] if is_outside else self._namespaces
        shell = [*namespaces, *self._change_root, "bash", "-c", lines]
        return subprocess.Popen(shell, text=True, **options)

    def close(self):
        self._holder.kill()
        self._holder.wait()


def indented_commands(text):
    return re.findall(r"(?m)^    (\S.*)$", re.sub(r"(?ms)^```.*?^```$", "", text))


def shown_outputs(text):
    """(command, lines of output) of each `$ ` in a fenced block."""
    for block in re.findall(r"(?ms)^```\n(.*?)^```$", text):
        for part in re.split(r"(?m)^\$ ", block)[1:]:
            command, *lines = part.rstrip("\n").split("\n")
            yield command, lines


def matches(shown, lines):
    pattern = "".join(r"(?:.*\n)*" if line == "..." else re.escape(line) + r"\n" for line in shown)
    return re.fullmatch(pattern, "".join(line + "\n" for line in lines)) is not None


def run(machine, command, quick_start):
    typed = quick_start if command == QUICK_START else command
    print(f"$ {typed}", flush=True)
    began_at = time.monotonic()
    process = machine.start(typed, is_outside=typed == QUICK_START, stdout=subprocess.DEVNULL)
    if process.wait() != 0:
        raise Mismatch(f"{command}: exit code = {process.returncode} (must be 0)")
    print(f"  {time.monotonic() - began_at:.1f} s", flush=True)
    if command == SHORTENED_AFTER:
        machine.start(SHORT_CAMPAIGN).wait()


def run_all(machine, text, quick_start):
    services = []
    try:
        for command in indented_commands(text):
            if command.startswith("export "):
                machine.export(command)
            elif command.startswith(SERVICES):
                print(f"$ {command} &", flush=True)
                services.append(machine.start("exec " + command, stderr=subprocess.DEVNULL))
            else:
                run(machine, command, quick_start)
        for command, shown in shown_outputs(text):
            print(f"$ {command}", flush=True)
            process = machine.start(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
            lines = process.communicate()[0].splitlines()
            if not matches(shown, lines):
                difference = f"{command}: the output differs from what the README shows:"
                raise Mismatch("\n".join([difference, *lines]))
    finally:
        for service in reversed(services):
            service.terminate()
        codes = [service.wait() for service in services]
    if any(codes):
        raise Mismatch(f"exit codes of coordinator and worker = {codes} (must be 0)")


def compare_pictures(machine, text, source):
    """Each picture that the README shows is what `plot` draws of the campaign of the quick start."""
    charts = re.findall(r'src="deploy/pictures/(\w+)\.svg"', text)
    if not charts:
        raise Mismatch("README.md: pictures = 0 (must be 1 or more)")
    for chart in charts:
        command = f"proofmass plot hardy2013.db --chart {chart} --output -"
        drawn = machine.start(command, stdout=subprocess.PIPE).communicate()[0]
        if drawn != (source / f"deploy/pictures/{chart}.svg").read_text(encoding="utf-8"):
            raise Mismatch(f"{command}: draws another picture than deploy/pictures/{chart}.svg")


def main():
    parser = argparse.ArgumentParser(description="Runs the commands of README.md.")
    where = parser.add_mutually_exclusive_group(required=True)
    where.add_argument("--programs", help="directory of the programs that were built")
    where.add_argument("--root", help="root directory of a bare Debian 12")
    parser.add_argument("--clone", help="with --root: where the clone is, seen from there")
    options = parser.parse_args()
    source = checking.SOURCE
    text = (source / "README.md").read_text(encoding="utf-8")
    directory = options.clone or tempfile.mkdtemp(prefix="proofmass-readme-")
    machine = Machine(options.root, directory)
    quick_start = QUICK_START
    if options.programs:
        machine.export(f"PATH={options.programs}:$PATH")
        quick_start = f"proofmass run {source}/deploy/campaigns/hardy2013.toml --db hardy2013.db"
    num_words = len(text.split())
    try:
        if num_words >= WORDS_MAX:
            raise Mismatch(f"README.md: words = {num_words} (must be below {WORDS_MAX})")
        run_all(machine, text, quick_start)
        compare_pictures(machine, text, source)
    except Mismatch as mismatch:
        print(mismatch, file=sys.stderr)
        return 1
    finally:
        machine.close()
        if options.programs:
            shutil.rmtree(directory)
    return 0


if __name__ == "__main__":
    sys.exit(main())
