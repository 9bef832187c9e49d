#!/usr/bin/env python3
"""Whether run.py takes what differs for different, with commands of the shell in the place of ours."""

import contextlib
import io
import os
import select
import subprocess
import sys
import tempfile
from pathlib import Path

import run

PASSING = [
    "  $ echo a\n  a",
    "  $ echo a; echo b >&2; exit_code() { return 3; }; exit_code\n  a\n  ! b\n  [3]",
    "  $ printf 'a\\nb\\nc\\n'\n  a\n  ...\n  c",
    "  $ echo 2024-01-31T12:00:00Z 1.5e-3 '{word}'\n  {time} {number} {word}",
    "  $ pwd; echo '{x}'\n  {dir}\n  {x}",
    "  $ cat <<END\n  > one\n  > END\n  one",
    "  $ export a=1\n\nProse.\n\n  $ echo $a  '  b' ───; sleep 100 &\n  1 b ──",
]
FAILING = [
    "  $ echo a",
    "  $ :\n  a",
    "  $ echo a\n  b",
    "  $ echo a\n  a b",
    "  $ echo a >&2\n  a",
    "  $ echo a\n  ! a",
    "  $ false",
    "  $ true\n  [1]",
    "  $ (exit 2)\n  [1]",
    "  $ printf 'a\\nb\\n'\n  b\n  a",
    "  $ printf 'a\\nb\\n'\n  ...\n  a",
    "  $ echo a.b\n  a?b",
    "  $ echo x\n  {number}",
    "  $ exit 0\n  $ echo a\n  a",
]


def passes(text, is_update=False):
    with tempfile.TemporaryDirectory() as directory, contextlib.redirect_stdout(io.StringIO()):
        path = Path(directory, "a.test")
        path.write_text(text + "\n", encoding="utf-8")
        result = run.run_file(path, Path(directory), is_update)
        return path.read_text(encoding="utf-8") if is_update else result


def ends_its_shell():
    """Whether SIGTERM, as of ctest or a service manager, leaves no process of the session."""
    with tempfile.TemporaryDirectory() as directory:
        path, pipe = Path(directory, "a.test"), Path(directory, "pipe")
        os.mkfifo(pipe)
        path.write_text(f"  $ echo $$ >{pipe}; sleep 1000\n", encoding="utf-8")
        runner = subprocess.Popen([sys.executable, run.__file__, "--programs", directory, path])
        shell = int(pipe.read_text(encoding="utf-8"))
        end_of_shell = os.pidfd_open(shell)
        runner.terminate()
        code = runner.wait()
        return code == 143 and select.select([end_of_shell], [], [], 100.0)[0] != []


def main():
    wrong = [text for text in PASSING if passes(text) is not True]
    wrong += [text for text in FAILING if passes(text) is not False]
    updated = passes("  $ echo a; echo 1; date -u +%FT%TZ\n  b\n  {number}\n\n  $ echo c\n  c", True)
    if updated != "  $ echo a; echo 1; date -u +%FT%TZ\n  a\n  {number}\n  {time}\n\n  $ echo c\n  c\n":
        wrong.append(updated)
    if not ends_its_shell():
        wrong.append("SIGTERM leaves the shell")
    print(*wrong, sep="\n---\n")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
