#!/usr/bin/env python3
"""Looks at the live page with a real browser and a real Prometheus.

A coordinator with a worker computes a small campaign and serves the page. In turn:

- headless Chromium opens each page in both themes, 1400 and 400 pixels wide: no error on the console,
  no request to another origin, no serious finding of axe-core, nothing wider than the window; figures
  are those of the database; the page changes by itself and keeps the focus; it says when the
  coordinator is gone; text of the database that looks like a script is shown as text;
- a page with a token refuses those without it, and the token leaves the address bar and reaches no
  log;
- Prometheus scrapes the metrics, and a query to it returns the number of finished runs.

Further HTML files, such as a report, are looked at in the same way if they are named. Needs node, npm
and its registry, chromium and prometheus. Exit code 0 if all holds, 1 if not; 77 if a program is
lacking, but then 1 if the environment has CI; 77 if the registry cannot be reached.
"""

import json
import re
import shutil
import signal
import sqlite3
import subprocess
import sys
import tempfile
import urllib.error
import urllib.parse
import urllib.request
from pathlib import Path

import checking
from checking import check, free_port, wait_until

NUM_RUNS = 64
TOKEN = "a-token-for-this-test-only"
HOSTILE = "<script>alert(1)</script> \x1b[31m \"quoted\""
HOSTILE_SHOWN = "<script>alert(1)</script> \\u001b[31m \"quoted\""
SCALES = {"nm": 1e-9, "10⁻⁴ rad": 1e-4, "10⁻⁶": 1e-6, "10⁻⁶ rad": 1e-6, "s²/m": 1.0}
PACKAGES = ("playwright-core@1", "axe-core@4")


def get(url, **headers):
    """Status and text of an answer."""
    try:
        with urllib.request.urlopen(urllib.request.Request(url, headers=headers), timeout=20) as got:
            return got.status, got.read().decode()
    except urllib.error.HTTPError as error:
        return error.code, error.read().decode()


class Coordinator:
    """A coordinator with a page, in a directory of its own."""

    def __init__(self, programs, directory, *arguments):
        self.directory = directory
        directory.mkdir(exist_ok=True)
        self.port = free_port()
        self.url = f"http://127.0.0.1:{self.port}/"
        self.log = (directory / "log").open("w+")
        self.process = subprocess.Popen(
            [programs / "proofmass-coordinator", "--directory", directory / "served", "--bind",
             f"ipc://{directory}/workers", f"--page=127.0.0.1:{self.port}", *arguments],
            stderr=self.log)
        wait_until("the page", lambda: self.is_there())

    def is_there(self):
        check(self.process.poll() is None, "coordinator: " + self.log_text())
        try:
            return get(self.url + "healthz") == (200, "ok\n")
        except OSError:
            return False

    def log_text(self):
        return Path(self.log.name).read_text()

    def end(self):
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGINT)
            self.process.wait(timeout=60)


def add_hostile_event(database):
    with sqlite3.connect(database, timeout=30) as connection:
        connection.execute("INSERT INTO event (kind, text) VALUES ('hostile', ?)", (HOSTILE,))
    connection.close()


def figure(value):
    """Three significant digits, as the program writes them."""
    mantissa, exponent = f"{value:.2e}".split("e")
    if value != 0 and not -4 < int(exponent) < 5:
        power = "10" + str(int(exponent)).translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))
        return f"{mantissa}×{power}"
    return f"{value:.{max(0, 2 - int(exponent))}f}" if value else "0"


def accuracy_cells(database, page):
    """What the table must show, from the database's view; the scale follows from the unit shown."""
    units = dict(re.findall(r'<th scope="row"[^>]*>([^<]+)</th><td class="words"[^>]*>([^<]*)</td>', page))
    units = {key.replace("&#39;", "'"): value for key, value in units.items()}
    connection = sqlite3.connect(f"file:{database}?mode=ro", uri=True)
    rows = connection.execute(
        "SELECT label, worst, mean, standard_deviation, num_beyond_objective "
        "FROM parameter_accuracy JOIN parameter USING (parameter)").fetchall()
    connection.close()
    cells = []
    for label, worst, mean, deviation, num_beyond in rows:
        scale = SCALES[units[label]]
        for column, text in (("worst", figure(worst / scale)), ("mean", figure(mean / scale)),
                             ("std", figure(deviation / scale)), ("beyond", str(num_beyond))):
            cells.append({"row": label, "column": column, "text": text})
    check(len(cells) == 40, f"cells = {len(cells)} (must be 40)")
    return cells


def check_with_browser(directory, order):
    file = directory / "order.json"
    file.write_text(json.dumps(order))
    done = subprocess.run(["node", Path(__file__).with_suffix(".mjs").resolve(), file],
                          cwd=directory / "node", capture_output=True, text=True, timeout=500)
    check(done.returncode == 0, "node: " + done.stderr)
    findings = json.loads(done.stdout)
    check(not findings, "\n".join(findings))


def install(directory):
    (directory / "node").mkdir()
    done = subprocess.run(["npm", "install", "--no-audit", "--no-fund", "--silent", *PACKAGES],
                          cwd=directory / "node", capture_output=True, text=True, timeout=300)
    return done.returncode == 0


def check_token(programs, directory, screenshots, chromium):
    file = directory / "token"
    file.write_text(TOKEN + "\n")
    file.chmod(0o600)
    coordinator = Coordinator(programs, directory / "guarded", "--page-token-file", file)
    try:
        for path in ("", "metrics", "workers"):
            check(get(coordinator.url + path)[0] == 401, f"{path}: is answered without the token")
            check(get(coordinator.url + path, Authorization="Bearer " + TOKEN)[0] == 200,
                  f"{path}: is not answered with the token")
        check_with_browser(directory, {
            "chromium": chromium, "screenshots": str(screenshots),
            "pages": [{"name": "guarded", "url": f"{coordinator.url}?token={TOKEN}",
                       "wait_for": "#live", "final_url": coordinator.url}]})
        check(TOKEN not in coordinator.log_text(), "the token is in the log")
    finally:
        coordinator.end()


def check_prometheus(directory, coordinator):
    _, metrics = get(coordinator.url + "metrics")
    done = subprocess.run(["promtool", "check", "metrics"], input=metrics, capture_output=True,
                          text=True)
    check(done.returncode == 0, "promtool: " + done.stderr)
    config = directory / "prometheus.yml"
    config.write_text(f"""scrape_configs:
  - job_name: proofmass
    scrape_interval: 1s
    static_configs:
      - targets: ['127.0.0.1:{coordinator.port}']
""")
    port = free_port()
    with (directory / "prometheus.log").open("w") as log:
        prometheus = subprocess.Popen(
            ["prometheus", f"--config.file={config}", f"--storage.tsdb.path={directory}/tsdb",
             f"--web.listen-address=127.0.0.1:{port}"], stdout=log, stderr=log)
    query = urllib.parse.urlencode({"query": 'proofmass_runs_finished_total{campaign="hardy2013"}'})

    def answer():
        try:
            _, text = get(f"http://127.0.0.1:{port}/api/v1/query?{query}")
            return [item["value"][1] for item in json.loads(text)["data"]["result"]]
        except (OSError, KeyError, ValueError):
            return []

    try:
        wait_until("a scrape", lambda: answer() == [str(NUM_RUNS)], 60)
    finally:
        prometheus.terminate()
        prometheus.wait(timeout=60)


def compute_campaign(programs, coordinator):
    with (coordinator.directory / "worker.log").open("w") as log:
        worker = subprocess.Popen(
            [programs / "proofmass-worker", "--connect", f"ipc://{coordinator.directory}/workers",
             "--threads", "1"], stderr=log)

    finished = 'proofmass_campaigns{phase="finished"} 1\n'
    wait_until("the end of the campaign", lambda: finished in get(coordinator.url + "metrics")[1],
               300)
    return worker


def pages_of(coordinator, database):
    page = coordinator.url + "campaigns/hardy2013"
    wait_until("all results on the page",
               lambda: f"{NUM_RUNS} of {NUM_RUNS} finished runs" in get(page)[1])
    connection = sqlite3.connect(f"file:{database}?mode=ro", uri=True)
    (num_results,) = connection.execute("SELECT count(*) FROM run_result").fetchone()
    connection.close()
    check(num_results == NUM_RUNS, f"results = {num_results} (must be {NUM_RUNS})")
    wait_until("the event", lambda: "hostile" in get(page)[1])
    return [
        {"name": "overview", "url": coordinator.url, "wait_for": "table", "live": "#live p",
         "cells": [{"row": "hardy2013", "column": "done", "text": str(num_results)},
                   {"row": "hardy2013", "column": "phase", "text": "finished"}]},
        {"name": "workers", "url": coordinator.url + "workers", "wait_for": "table"},
        {"name": "campaign", "url": page, "wait_for": "section table",
         "cells": accuracy_cells(database, get(page)[1]),
         "numbers": {"tr:has-text('hostile') td >> nth=1": HOSTILE_SHOWN}},
    ]


def check_all(arguments, directory, chromium):
    programs = arguments.programs.resolve()
    screenshots = arguments.screenshots or directory / "screenshots"
    screenshots.mkdir(exist_ok=True)
    checking.write_short_campaign(programs, directory, NUM_RUNS)
    coordinator = Coordinator(programs, directory / "open", directory / "short.toml")
    worker = None
    try:
        worker = compute_campaign(programs, coordinator)
        database = coordinator.directory / "served/hardy2013.db"
        add_hostile_event(database)
        pages = pages_of(coordinator, database)
        check_prometheus(directory, coordinator)
        for number, file in enumerate(arguments.html):
            pages.append({"name": f"file-{number}", "url": file.resolve().as_uri(),
                          "wait_for": "body"})
        check_with_browser(directory, {
            "chromium": chromium, "screenshots": str(screenshots), "pages": pages,
            "end": {"url": coordinator.url, "process_id": coordinator.process.pid,
                    "text": "The coordinator cannot be reached since "}})
        coordinator.process.wait(timeout=60)
    finally:
        coordinator.end()
        if worker is not None:
            worker.terminate()
            worker.wait(timeout=60)
    check_token(programs, directory, screenshots, chromium)


def main():
    parser = checking.parser_of(__doc__)
    parser.add_argument("--html", type=Path, action="append", default=[],
                        help="a further file to be looked at")
    parser.add_argument("--screenshots", type=Path, help="where they are kept")
    arguments = parser.parse_args()
    chromium = shutil.which("chromium")
    lacking = [name for name in ("node", "npm", "chromium", "prometheus", "promtool")
               if not shutil.which(name)]
    with tempfile.TemporaryDirectory(prefix="page_check.") as name:
        directory = Path(name)
        if lacking:
            checking.skip("needs " + ", ".join(lacking))
        if not install(directory):
            print("SKIPPED: the registry of npm cannot be reached")
            sys.exit(77)
        with checking.failure_told():
            check_all(arguments, directory, chromium)


if __name__ == "__main__":
    main()
