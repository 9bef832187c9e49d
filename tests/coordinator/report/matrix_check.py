#!/usr/bin/env python3
"""Computes every figure of the verification matrix of a report anew, from the raw columns.

    matrix_check.py --programs build/release/bin

Runs a small campaign, lets `proofmass report --html` write a report of requirements of all kinds, and
compares each cell of its matrix with what scipy makes of the estimates and truths in the database.
Ends with 77 if scipy is not installed, unless CI is set.
"""

import argparse
import html.parser
import math
import os
import pathlib
import re
import sqlite3
import subprocess
import sys
import tempfile

try:
    from scipy.stats import binom
except ImportError:
    print("matrix_check: no scipy")
    sys.exit(1 if "CI" in os.environ else 77)

SHORTEN = {"orbits": "2", "sample_period_s": "1", "runs": "64"}
COLUMNS = "id requirement verdict limit draws without exceedances allowed bound margin worst run".split()


class Matrix(html.parser.HTMLParser):
    """The rows of the body of the table `matrix`: pairs of text and value of each cell."""

    def __init__(self):
        super().__init__()
        self.rows, self.is_in = [], False

    def handle_starttag(self, tag, attributes):
        attributes = dict(attributes)
        if tag == "table":
            self.is_in = attributes["id"] == "matrix"
        if not self.is_in:
            return
        if tag == "tr":
            self.rows.append([])
        if tag in ("td", "th"):
            value = attributes.get("data-value")
            self.rows[-1].append(["", None if value is None else float(value)])

    def handle_endtag(self, tag):
        if tag == "table":
            self.is_in = False

    def handle_data(self, data):
        if self.is_in and self.rows and self.rows[-1]:
            self.rows[-1][-1][0] += data.strip("\n")


def errors_of(database, name):
    """|estimate − truth| of each run, infinite for one without an estimate."""
    (suffix,) = database.execute(
        "SELECT name FROM pragma_table_info('run_result') WHERE name LIKE 'truth_' || ? || '%'"
        " ORDER BY length(name) LIMIT 1", (name,)).fetchone()
    column = suffix[len("truth_"):]
    rows = database.execute(
        f"SELECT run_index, estimate_{column} - truth_{column} FROM run_result ORDER BY run_index")
    return {run: math.inf if error is None else abs(error) for run, error in rows}


def expected_row(database, requirement):
    """What the row of a requirement must hold."""
    form = r"(?:(\w+) (<=?) (\S+)|all objectives) for ([\d.]+)% with ([\d.]+)%"
    name, sign, limit, coverage, confidence = re.search(form, requirement).groups()
    coverage, confidence = float(coverage) / 100, float(confidence) / 100
    if name:
        limit = float(limit)
        values = errors_of(database, name)
        beyond = sum(value > limit or (sign == "<" and value == limit) for value in values.values())
    else:
        limit = 1.0
        values = {}
        objectives = database.execute("SELECT parameter, objective FROM parameter").fetchall()
        for parameter, objective in objectives:
            for run, error in errors_of(database, parameter).items():
                values[run] = max(values.get(run, 0.0), error / objective)
        beyond = sum(value > limit for value in values.values())
    n, q, doubt = len(values), 1 - coverage, (1 - confidence) * (1 + 1e-9)
    order = 0
    while order < n and binom.cdf(order, n, q) <= doubt:
        order += 1
    bound = sorted(values.values(), reverse=True)[order - 1] if order else math.inf
    num_enough = n
    while binom.cdf(beyond, num_enough, q) > doubt:
        num_enough += 1
    verdict = "undecided"
    if binom.cdf(beyond, n, q) <= doubt:
        verdict = "met"
    elif binom.sf(beyond - 1, n, q) <= doubt:
        verdict = "not met"
    finite = {run: value for run, value in values.items() if math.isfinite(value)}
    run, worst = max(finite.items(), key=lambda item: (item[1], -item[0]))
    is_bound = math.isfinite(bound)
    return {"limit": limit, "relation": "<" if sign == "<" else "≤", "draws": n, "without": n - len(finite),
            "exceedances": beyond, "allowed": order - 1 if order else (beyond, num_enough),
            "bound": bound if is_bound else "none",
            "margin": 1 - bound / limit if is_bound else "none",
            "verdict": verdict, "worst": worst, "run": run}


def is_shown(text, value):
    """Whether the number at the start of a text has the digits of the value; units are powers of ten."""
    shown = float(re.match(r"[0-9.]+", text.replace("−", "")).group()) * (-1 if text[0] == "−" else 1)
    if value == 0 or shown == 0:
        return value == shown or abs(value) < 1e-12
    ratio = shown / value
    return ratio > 0 and abs(ratio / 10 ** round(math.log10(ratio)) - 1) < 6e-3


def differences(row, expected):
    found = []
    for column, (text, value) in zip(COLUMNS, row):
        if column not in expected:
            continue
        wanted = expected[column]
        if column == "limit":
            relation, text = text.split(" ", 1)
            if relation != expected["relation"]:
                found.append(f"limit has {relation} (must be {expected['relation']})")
        if isinstance(wanted, tuple):  # Those who go on need no fewer than who begin with so many.
            beyond, num_enough = wanted
            shown = re.fullmatch(r"(\d+) of (\d+)", text)
            is_met_by_more = shown and int(shown[1]) == beyond and int(shown[2]) >= num_enough
            if not is_met_by_more and (text, expected["verdict"]) != ("too few draws", "not met"):
                found.append(f"{column} = {text} (must be {beyond} of {num_enough} or more)")
        elif isinstance(wanted, str):
            if text != wanted:
                found.append(f"{column} = {text} (must be {wanted})")
        elif value is None or abs(value - wanted) > 1e-12 * abs(wanted) + 1e-15:
            found.append(f"{column} = {value} (must be {wanted})")
        elif column == "run":
            if text != str(wanted):
                found.append(f"run is shown as {text} (must be {wanted})")
        elif not is_shown(text, wanted):
            found.append(f"{column} is shown as {text} (must be {wanted})")
    return found


def small_campaign(programs, folder):
    subprocess.run([programs / "proofmass", "init", folder / "paper.toml"], check=True)
    lines = []
    for line in (folder / "paper.toml").read_text().splitlines():
        key = line.split(" = ")[0]
        lines.append(f"{key} = {SHORTEN[key]}" if key in SHORTEN else line)
    (folder / "small.toml").write_text("\n".join(lines) + "\n")
    subprocess.run([programs / "proofmass", "run", folder / "small.toml", "--quiet", "--db",
                    folder / "small.db"], check=True, stdout=subprocess.DEVNULL)


def write_requirements(file, database):
    """Some that are met, some that are not, and some that are undecided or lack draws."""
    middle = sorted(errors_of(database, "a_c13").values())[32]
    requirements = [f"a_c12 < {limit} for {tolerance}"
                    for limit in (9e-4, 9e-3, 9e-2)
                    for tolerance in ("95% with 90%", "50% with 99%", "99.9% with 95%")]
    requirements += [f"a_c13 < {middle!r} for 50% with 95%", f"a_c13 <= {middle!r} for 50% with 95%",
                     "k2c < 1e9 for 90% with 99.5%",
                     "all objectives for 40% with 90%"]
    with open(file, "w", encoding="utf-8") as stream:
        for number, requirement in enumerate(requirements):
            print(f'[[requirements]]\nid = "R-{number}"\nrequirement = "{requirement}"', file=stream)
    return requirements


def check(programs, folder):
    small_campaign(programs, folder)
    database = sqlite3.connect(f"file:{folder / 'small.db'}?mode=ro", uri=True)
    stated = write_requirements(folder / "requirements.toml", database)
    objectives = [f"{name} <= {objective!r} for 95% with 90%" for name, objective in database.execute(
        "SELECT parameter, objective FROM parameter ORDER BY position")] + ["all objectives for 95% with 90%"]
    problems, verdicts = [], set()
    for options, requirements in ((["--requirements", folder / "requirements.toml"], stated),
                                  ([], objectives)):
        report = subprocess.run(
            [programs / "proofmass", "report", folder / "small.db", "--html", "-", *options],
            stdout=subprocess.PIPE, check=False, text=True).stdout
        matrix = Matrix()
        matrix.feed(report)
        rows = [row for row in matrix.rows if len(row) == len(COLUMNS) and row[COLUMNS.index("limit")][1] is not None]
        if len(rows) != len(requirements):
            problems.append(f"{len(rows)} rows (must be {len(requirements)})")
        for row, requirement in zip(rows, requirements):
            verdicts.add(row[COLUMNS.index("verdict")][0])
            problems += [f"{row[0][0]}: {what}"
                         for what in differences(row, expected_row(database, requirement))]
    if verdicts != {"met", "not met", "undecided"}:
        problems.append(f"verdicts = {sorted(verdicts)} (must be all three: change the requirements)")
    return problems


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--programs", type=pathlib.Path, required=True)
    programs = parser.parse_args().programs.resolve()
    with tempfile.TemporaryDirectory() as folder:
        problems = check(programs, pathlib.Path(folder))
    print("\n".join(problems) if problems else "matrix_check: all figures agree")
    return 1 if problems else 0


if __name__ == "__main__":
    sys.exit(main())
