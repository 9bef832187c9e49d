#!/usr/bin/env python3
"""Uses mutated campaign databases in several processes, and goes on after those that a process died of.

    tests/fuzz/file_fuzz.py --program build/asan/bin/proofmass_fuzz_files --files 1:100000 --jobs 2

Each file follows from its number. What a process died of, and exceptions that are no proofmass::Error,
are printed once with the first number; exit code 1 if there were any. A file that was found is made
again by `proofmass_fuzz_files NUMBER NUMBER DIRECTORY`, as DIRECTORY/used/x.db.
"""

import argparse
import concurrent.futures
import pathlib
import re
import subprocess
import sys
import tempfile
import threading
import time

USES = ["list", "report", "requirement", "sensitivity", "export_hdf5", "compare",
        "query", "verify", "back_up", "run", "serve"]


class Findings:
    def __init__(self):
        self.lock = threading.Lock()
        self.numbers = {}  # By what was found.

    def add(self, number, text):
        what = f"{USES[number % len(USES)]}: {re.sub(r'0x[0-9a-f]+|==[0-9]+==', '', text)}"
        with self.lock:
            if what not in self.numbers:
                print(f"file {number} {what}", flush=True)
            self.numbers.setdefault(what, []).append(number)


def reason_of(process_end, errors):
    marks = re.findall(r"(?m)^.*(?:internal invariant broken|ERROR: AddressSanitizer|runtime error"
                       r"|terminate called|what\(\)|LeakSanitizer|SUMMARY).*$", errors)
    return f"ended with {process_end}: {'; '.join(marks[:3]) or errors[-300:]}"


def use_files(program, first, last, findings):
    with tempfile.TemporaryDirectory(prefix="file_fuzz.", dir="/dev/shm") as folder:
        number = first
        while number <= last:
            done = subprocess.run([program, str(number), str(last), folder], text=True,
                                  stdout=subprocess.PIPE, stderr=subprocess.PIPE, check=False,
                                  errors="replace")
            for line in done.stdout.splitlines():
                found = re.match(r"seed (\d+) use \d+: (.*)", line)
                if found:
                    findings.add(int(found.group(1)), f"exception {found.group(2)}")
            if done.returncode in (0, 1):
                return
            number = int((pathlib.Path(folder) / "number").read_text())
            findings.add(number, reason_of(done.returncode, done.stderr))
            number += 1


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--program", type=pathlib.Path, required=True)
    parser.add_argument("--files", default="1:1000", help="FIRST:LAST")
    parser.add_argument("--jobs", type=int, default=2)
    options = parser.parse_args()
    first, last = map(int, options.files.split(":"))
    findings = Findings()
    begin = time.monotonic()
    size = 500
    with concurrent.futures.ThreadPoolExecutor(options.jobs) as pool:
        list(pool.map(lambda at: use_files(options.program.resolve(), at,
                                           min(at + size - 1, last), findings),
                      range(first, last + 1, size)))
    print(f"{last - first + 1} files in {time.monotonic() - begin:.0f} s; {len(findings.numbers)} "
          "findings")
    for what, numbers in sorted(findings.numbers.items()):
        print(f"{len(numbers):6} times, first {numbers[0]}: {what}")
    return 1 if findings.numbers else 0


if __name__ == "__main__":
    sys.exit(main())
