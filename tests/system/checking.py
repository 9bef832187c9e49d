"""What the checks of this folder share."""

import argparse
import contextlib
import os
import re
import socket
import subprocess
import sys
import time
from pathlib import Path

SOURCE = Path(__file__).resolve().parents[2]


def check(is_true, what):
    if not is_true:
        raise AssertionError(what)


def wait_until(what, holds, limit_s=600):
    end = time.monotonic() + limit_s
    while not holds():
        check(time.monotonic() < end, f"{what} did not come in {limit_s} s")
        time.sleep(0.05)


def skip(reason):
    """Ends the check on a machine that lacks something: skipped, but failed in CI."""
    print(f"SKIPPED: {reason}")
    sys.exit(1 if "CI" in os.environ else 77)


def parser_of(description, directory="programs"):
    """Of the arguments of a check, of which the directory of the programs or of the build is one."""
    parser = argparse.ArgumentParser(
        description=description, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument(
        f"--{directory}", required=True, type=Path, help=f"directory of the {directory}"
    )
    return parser


@contextlib.contextmanager
def failure_told(logs=lambda: ()):
    """Prints what does not hold, with the ends of the logs, and ends the check with 1."""
    try:
        yield
    except AssertionError as error:
        print(f"FAILED: {error}")
        for log in sorted(logs()):
            print(f"{log}:", *log.read_text().splitlines()[-30:], sep="\n  ")
        sys.exit(1)


def free_port():
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        return listener.getsockname()[1]


def output_of(*command, **more):
    process = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=False, **more)
    check(process.returncode == 0, f"{command} gives {process.returncode}\n{process.stdout}")
    return process.stdout


def shortening(runs):
    """For `sed -E`: the paper's campaign with so many runs of an orbit a session, which take milliseconds."""
    settings = {"orbits": 1, "sample_period_s": 1, "settling_s": 1100, "runs": runs}
    return ";".join(f"s/^{key} = .*/{key} = {value}/" for key, value in settings.items())


def write_short_campaign(programs, directory, runs):
    """paper.toml and, shortened, short.toml."""
    output_of(programs / "proofmass", "init", "paper.toml", cwd=directory)
    text = output_of("sed", "-E", shortening(runs), directory / "paper.toml")
    (directory / "short.toml").write_text(text)


def digest_of(report):
    return re.search(r"^Digest +(\w+)", report, re.MULTILINE)[1]


def reference(programs, directory, runs):
    """The digest of the short campaign by `proofmass run`."""
    write_short_campaign(programs, directory, runs)
    run = ("run", "short.toml", "--db", "run.db", "--quiet")
    output_of(programs / "proofmass", *run, cwd=directory)
    return digest_of(output_of(programs / "proofmass", "report", "run.db", cwd=directory))
