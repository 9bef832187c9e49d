#!/usr/bin/env python3
"""Runs the sessions of a shell that text files show, and compares what they print.

    tests/text/run.py --programs build/release/bin tests/text/query.test
    tests/text/run.py --programs build/release/bin --update tests/text/*.test

README.md describes the files. Exit code 0 if everything is as shown, 1 if not; 77 if a file needs
a program that this machine lacks, but 1 if the environment has CI. With --update, the expected
output of a command that printed something else is replaced by what it printed.
"""

import argparse
import difflib
import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
from dataclasses import dataclass, field
from pathlib import Path

SOURCE = Path(__file__).resolve().parents[2]
INDENT = "  "
END_OF_ERROR = "! "  # Before a line of standard error.

# What the names in braces stand for. Other text in braces stands for itself.
PATTERNS = {
    "any": r".*?",
    "date": r"\d{4}-\d\d-\d\d",
    "digest": r"[0-9a-f]{64}",
    "duration": r"\d+(?:\.\d+)? (?:ms|s|min|h|d)(?: \d+ (?:s|min|h))?",
    "hex": r"[0-9a-f]+",
    "number": r"[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?",
    "time": r"\d{4}-\d\d-\d\d[T ]\d\d:\d\d:\d\d(?:\.\d+)?Z?",
    "version": r"\d+\.\d+\.\d+(?:-\w+)?",
    "word": r"\S+",
}


# Before a shell that has mounts of its own, which go with it.
WITH_MOUNTS = ["unshare", "--mount", "--propagation", "private"]


# Waits until a command succeeds. Until then it may find no file yet. Counting the waits takes no
# process for each, as reading the clock would.
AWAIT = """await() {
  await_left=5000
  until eval "$1" 2>/dev/null; do
    [ $await_left -gt 0 ] || { echo "not within 100 s: $1"; return 1; }
    await_left=$((await_left - 1)); sleep 0.02
  done
}
"""


class Mistake(Exception):
    """A file that is not written as README.md says."""


@dataclass
class Step:
    """A command and what it has to print."""

    line: int  # Of the command, from 1.
    command: str
    begin: int  # Position of the first line of output among the lines of the file.
    expected: list[str] = field(default_factory=list)  # Without indentation and blank lines.
    end: int = 0

    @property
    def exit_code(self):
        last = self.expected[-1] if self.expected else ""
        return int(last[1:-1]) if re.fullmatch(r"\[\d+\]", last) else 0


def read_steps(lines):
    """The steps of a file, and the programs that it needs."""
    steps, needed, is_open = [], [], False
    for number, line in enumerate(lines, 1):
        text = line[len(INDENT):]
        if line.startswith("needs: "):
            needed += line.split()[1:]
        elif line and not line.startswith(INDENT):
            is_open = False
        elif text.startswith("$ "):
            steps.append(Step(number, text[2:], number, end=number))
            is_open = True
        elif text.startswith("> ") or text == ">":
            if not is_open or steps[-1].expected:
                raise Mistake(f"line {number}: no command goes on here")
            steps[-1].command += "\n" + text[2:]
            steps[-1].begin = steps[-1].end = number
        elif text.strip():
            if not is_open:
                raise Mistake(f"line {number}: output without a command")
            steps[-1].expected.append(text.rstrip())
            steps[-1].end = number
    return steps, needed


class Session:
    """One shell in one directory of its own, which goes with it."""

    def __init__(self, programs):
        self.directory = tempfile.mkdtemp(prefix="proofmass-text-")
        self._streams = tempfile.mkdtemp(prefix="proofmass-text-")
        environment = {
            name: value
            for name, value in os.environ.items()
            if not name.startswith(("PROOFMASS_", "SLURM_")) and name not in ("COLUMNS", "NO_COLOR")
        }
        environment |= {
            # Debian's Python, which has what install-deps.sh installs, before any other one.
            "PATH": f"{programs}:/usr/bin:{environment['PATH']}",
            "HOME": self.directory,
            "LC_ALL": "C.UTF-8",
            "TZ": "UTC",
            "SOURCE": str(SOURCE),
            "PROGRAMS": str(programs),
        }
        self._environment = environment

    def run(self, steps, time_max_s, prefix=()):
        """What each step printed, as (lines of output, lines of error, exit code); fewer if the
        shell ended before. The prefix stands before the command of the shell."""
        mark = f"proofmass-text-{os.getpid()}-end"
        script = AWAIT + "".join(
            f"{step.command}\nprintf '\\n{mark} %d\\n' $?; printf '\\n{mark}\\n' >&2\n"
            for step in steps
        )
        paths = [Path(self._streams, name) for name in ("script", "output", "error")]
        paths[0].write_text(script, encoding="utf-8")
        with open(paths[1], "wb") as output, open(paths[2], "wb") as error:
            shell = None
            try:  # A signal may come while the shell, which has begun, is still being started.
                shell = subprocess.Popen(
                    [*prefix, "sh", paths[0]], cwd=self.directory, env=self._environment,
                    stdout=output, stderr=error, stdin=subprocess.DEVNULL, start_new_session=True)
                shell.wait(time_max_s)
            except subprocess.TimeoutExpired:
                print(f"not finished after {time_max_s} s")
            finally:
                self._end_all()
                if shell is not None:
                    shell.wait()
        texts = [path.read_text(encoding="utf-8", errors="replace") for path in paths[1:]]
        outputs = re.split(rf"\n{mark} (\d+)\n", texts[0])
        errors = re.split(rf"\n{mark}\n", texts[1])
        self.rest = outputs[-1], errors[-1]
        codes = map(int, outputs[1::2])
        return [(self._lines(output), self._lines(error), code)
                for output, error, code in zip(outputs[::2], errors, codes)]

    def _end_all(self):
        """Ends the shell and what it left in the background, which has the directory as its home."""
        home = f"HOME={self.directory}".encode()
        is_any = True
        while is_any:
            is_any = False
            for path in Path("/proc").glob("[0-9]*/environ"):
                try:
                    if home in path.read_bytes().split(b"\0"):
                        os.kill(int(path.parent.name), signal.SIGKILL)
                        is_any = True
                except OSError:
                    pass  # It has ended, or is of somebody else.

    def print_logs(self):
        """The ends of the files that the steps wrote as logs."""
        for path in sorted(Path(self.directory).glob("*log")):
            text = path.read_text(encoding="utf-8", errors="replace")
            print(f"{path.name}:", *text.splitlines()[-10:], sep="\n    ")

    def _lines(self, text):
        text = text.replace(self.directory, "{dir}").replace(str(SOURCE), "{source}")
        return [line.rstrip() for line in text.splitlines() if line.strip()]

    def close(self):
        shutil.rmtree(self.directory, ignore_errors=True)
        shutil.rmtree(self._streams, ignore_errors=True)


def printed_lines(output, error, code):
    """As a file shows them."""
    return output + [END_OF_ERROR + line for line in error] + ([f"[{code}]"] if code else [])


def pattern_of(line):
    """Of a line of expected output: blanks in a row count as one, and so do the lines of a rule."""
    parts = re.split(r"(\{[a-z]+\}| +|─+)", line)
    pattern = ""
    for part in parts:
        if part.startswith("{") and part[1:-1] in PATTERNS:
            pattern += PATTERNS[part[1:-1]]
        elif part.startswith(" "):
            pattern += " +"
        else:
            pattern += "─+" if part.startswith("─") else re.escape(part)
    return pattern


def is_as_expected(expected, printed):
    pattern = "".join(
        r"(?:.*\n)*?" if line == "..." else pattern_of(line) + r"\n" for line in expected)
    return re.fullmatch(pattern, "".join(line + "\n" for line in printed)) is not None


def in_expected_words(expected, printed):
    """The printed lines, those that match an expected one in its spelling. Lines where `...` stands
    stay `...`."""
    words, position, is_elided = [], 0, False
    for line in printed:
        following = range(position, len(expected))
        found = next((i for i in following
                      if expected[i] != "..." and re.fullmatch(pattern_of(expected[i]), line)), None)
        if found is None and position < len(expected) and expected[position] == "...":
            is_elided = True
            continue
        if found is None:
            words.append(line)
            continue
        if "..." in expected[position:found] or is_elided:
            words.append("...")
        words.append(expected[found])
        position, is_elided = found + 1, False
    return words + (["..."] if is_elided else [])


def with_patterns(line):
    """A printed line as --update writes it."""
    line = re.sub(PATTERNS["time"], "{time}", line)
    line = re.sub(PATTERNS["date"], "{date}", line)
    line = re.sub(rf"\b{PATTERNS['digest']}\b", "{digest}", line)
    return re.sub(r"(?<=proofmass )\d+\.\d+\.\d+", "{version}", line)


def report(path, step, printed):
    print(f"{path}:{step.line}: {step.command.splitlines()[0]}")
    words = in_expected_words(step.expected, printed)
    for line in list(difflib.unified_diff(step.expected, words, "expected", "printed", lineterm=""))[2:]:
        print("    " + line)
    if words == step.expected:
        print("    lines are missing, or in another order")


def updated(lines, replacements):
    """The file with the output of each of these (step, printed) in place of the expected one."""
    for step, printed in sorted(replacements, key=lambda of: -of[0].line):
        words = in_expected_words(step.expected, printed)
        kept = set(step.expected)
        text = [INDENT + (line if line in kept else with_patterns(line)) for line in words]
        lines[step.begin:step.end] = text
    return lines


def is_there(need):
    """Whether the machine has a program, a file with an absolute path, or lets have mounts."""
    if need == "mounts":
        return subprocess.run([*WITH_MOUNTS, "true"], stderr=subprocess.DEVNULL).returncode == 0
    return shutil.which(need) is not None or need.startswith("/") and os.path.exists(need)


def run_file(path, programs, is_update, time_max_s=400):
    """Whether all is as expected; null if the file needs what this machine lacks."""
    lines = path.read_text(encoding="utf-8").splitlines()
    steps, needed = read_steps(lines)
    lacking = [need for need in needed if not is_there(need)]
    if lacking:
        print(f"{path}: SKIPPED: needs {' '.join(lacking)}")
        return None
    session = Session(programs)
    try:
        results = session.run(steps, time_max_s, WITH_MOUNTS if "mounts" in needed else ())
        different = []
        for step, (output, error, code) in zip(steps, results):
            printed = printed_lines(output, error, code)
            if not is_as_expected(step.expected, printed):
                different.append((step, printed))
        if not is_update and (different or len(results) < len(steps)):
            session.print_logs()
    finally:
        session.close()
    if is_update:
        path.write_text("\n".join(updated(lines, different)) + "\n", encoding="utf-8")
    else:
        for step, printed in different:
            report(path, step, printed)
    if len(results) < len(steps):
        for step, result in list(zip(steps, results))[-5:]:
            print(f"{path}:{step.line}: {step.command}", *printed_lines(*result), sep="\n    ")
        step = steps[len(results)]
        print(f"{path}:{step.line}: the shell ended here: {step.command}", *session.rest, sep="\n")
        return False
    return not different


def main():
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))  # Past what ends the shell.
    parser = argparse.ArgumentParser(description="Runs the sessions that text files show.")
    parser.add_argument("--programs", required=True, type=Path, help="directory of the programs")
    parser.add_argument("--update", action="store_true", help="write what was printed into FILE")
    parser.add_argument("--timeout", type=float, default=400, help="seconds for a file; 400")
    parser.add_argument("files", nargs="+", type=Path, metavar="FILE")
    options = parser.parse_args()
    try:
        passed = [run_file(path, options.programs.resolve(), options.update, options.timeout)
                  for path in options.files]
    except Mistake as mistake:
        print(f"run.py: error: {mistake}", file=sys.stderr)
        return 1
    if not all(result is not False for result in passed):
        return 0 if options.update and len(passed) else 1
    if None in passed:
        return 1 if "CI" in os.environ else 77
    return 0


if __name__ == "__main__":
    sys.exit(main())
