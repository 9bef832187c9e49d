#!/usr/bin/env python3
"""Reads campaigns with deploy/python/proofmass.py and compares every number with what others
read: `proofmass report --json`, SQL by sqlite3, `proofmass query` for the draws and h5py for a
replay; with pandas and without it, of MICROSCOPE's model and of another one. Then it runs the
example, which must draw its figures.

Needs Debian's python3-numpy, -pandas, -matplotlib and -h5py. Exit code 0 if all holds, 1 if not; 77
if it cannot run, but 1 if the environment has CI.
"""

import hashlib
import json
import os
import shutil
import sqlite3
import subprocess
import sys
import tempfile
from pathlib import Path

import checking

DEPLOY = checking.SOURCE / "deploy" / "python"
PYTHON = "/usr/bin/python3"  # Debian's, for which its packages are.
PACKAGES = ("numpy", "pandas", "matplotlib", "h5py")
NUM_RUNS = 48


class Programs:
    """The programs of a model, in a directory."""

    def __init__(self, programs, directory):
        self.program = str(programs / "proofmass")
        self.directory = directory
        directory.mkdir()

    def run(self, *words, exit_codes=(0,)):
        done = subprocess.run([self.program, *map(str, words)], cwd=self.directory, text=True,
                              capture_output=True, check=False)
        assert done.returncode in exit_codes, f"{words}: {done.returncode}: {done.stderr}"
        return done.stdout

    def json(self, *words):
        return json.loads(self.run(*words))

    def path(self, name):
        return self.directory / name


def microscope(programs, directory):
    """A campaign of which some runs are lost: those whose largest acceleration is in the upper half."""
    machine = Programs(programs, directory)
    checking.write_short_campaign(programs, directory, NUM_RUNS)
    machine.run("run", "short.toml", "--db", "whole.db")
    with sqlite3.connect(machine.path("whole.db")) as database:
        limit, = database.execute("SELECT health_acceleration_m_s2 FROM run_result "
                                  "ORDER BY 1 LIMIT 1 OFFSET ?", (NUM_RUNS // 2,)).fetchone()
    machine.run("run", "short.toml", "--db", "a.db", "--set", f"sensor.range_m_s2={limit!r}")
    return machine


def oscillator(programs, directory):
    machine = Programs(programs, directory)
    machine.run("init", "example.toml")
    machine.run("run", "example.toml", "--db", "a.db", "--runs", "50")
    return machine


def sql(machine, statement):
    with sqlite3.connect(machine.path("a.db")) as database:
        return database.execute(statement).fetchall()


def check_identity(machine, campaign):
    report = machine.json("report", "a.db", "--json")
    assert campaign.name == report["campaign"], campaign.name
    assert str(campaign.seed) == report["seed"], campaign.seed
    assert campaign.digest == report["digest"], campaign.digest
    assert campaign.definition["campaign"]["name"] == campaign.name
    assert [(one.name, one.symbol, one.unit, one.objective) for one in campaign.quantities] == [
        (one["parameter"], one["symbol"], one["unit"], one["objective"])
        for one in report["parameters"]]


def check_results(machine, campaign, numpy):
    """Each number has the bits that SQL reads."""
    results = campaign.results()
    names = [row[1] for row in sql(machine, "PRAGMA table_xinfo(run_result)")]
    stored = sql(machine, f"SELECT {', '.join(names)} FROM run_result ORDER BY run_index")
    statuses = dict(sql(machine, "SELECT run_index, status FROM run"))
    runs = list(results.index if hasattr(results, "index") else results["run_index"])
    assert runs == sorted(statuses), "the runs"
    assert list(results["status"]) == [statuses[run] for run in runs], "the status"
    for i, name in enumerate(names):
        if name in ("run_index", "status", "loss_cause", "loss_session", "correlations"):
            continue
        expected = numpy.array([numpy.nan if row[i] is None else row[i] for row in stored], float)
        own = numpy.asarray(results[name], float)
        assert numpy.array_equal(own, expected, equal_nan=True), name
    losses = {row[0]: row[1:] for row in sql(
        machine, "SELECT run_index, loss_cause, loss_session FROM loop_health "
                 "WHERE loss_cause IS NOT NULL")}
    for i, run in enumerate(runs):
        own = tuple(numpy.asarray(results[name])[i] for name in ("loss_cause", "loss_session"))
        assert own == losses.get(run, ("", "")), f"the loss of run {run}"
    units = results.attrs["units"] if hasattr(results, "attrs") else results.units
    for quantity in campaign.quantities:
        assert units[quantity.error] == units[quantity.truth] == quantity.unit, quantity.name
    return len(losses)


def check_accuracy(machine, campaign, numpy):
    """The program adds up with compensation, numpy in pairs: they agree to some bits."""
    report = machine.json("report", "a.db", "--json")["parameters"]
    accuracy, statistics = campaign.accuracy(), campaign.statistics()
    for i, expected in enumerate(report):
        def own(table, name, i=i):
            return numpy.asarray(table[name])[i]
        assert own(accuracy, "worst") == expected["worst"] == own(statistics, "worst")
        assert own(accuracy, "worst_run") == expected["worst_run"]
        # Nothing is beyond an objective that there is not: null, and 0 in a column of integers.
        assert own(accuracy, "num_beyond") == (expected["num_beyond_objective"] or 0)
        assert own(statistics, "mean") == expected["mean"]
        assert own(statistics, "mean_lower") == expected["mean_interval"][0]
        for name in ("mean", "standard_deviation"):
            assert abs(own(accuracy, name) / expected[name] - 1) < 1e-13, (name, i)


def check_unconverged(machine, proofmass, numpy):
    """A run whose estimates still moved has them, and is none of those that are accurate or not."""
    copy = machine.path("unconverged.db")
    shutil.copy(machine.path("a.db"), copy)
    with sqlite3.connect(copy) as database:
        run, = database.execute("SELECT min(run_index) FROM run_result WHERE status = 1").fetchone()
        database.execute("UPDATE run_result SET status = 2 WHERE run_index = ?", (run,))
    with proofmass.open(machine.path("a.db")) as of_all, proofmass.open(copy) as of_others:
        counts = [int(numpy.asarray(of.accuracy()["num_runs"])[0]) for of in (of_all, of_others)]
    assert counts[1] == counts[0] - 1, counts


def check_draws(machine, campaign, numpy):
    draws = campaign.draws(machine.program)
    rows = machine.json("query", "a.db", "SELECT run_index, quantity, unit, value FROM draw",
                        "--format", "json", "--rows-max", "1000000")
    rows = rows["rows"] if isinstance(rows, dict) else rows
    runs = list(draws.index if hasattr(draws, "index") else draws["run_index"])
    place = {run: i for i, run in enumerate(runs)}
    units = draws.attrs["units"] if hasattr(draws, "attrs") else draws.units
    assert rows, "draws"
    for row in rows:
        run, quantity, unit, value = row.values() if isinstance(row, dict) else row
        if run in place:
            assert numpy.asarray(draws[quantity])[place[run]] == value, (run, quantity)
            assert units[quantity] == unit, quantity


def check_replay(machine, proofmass, numpy):
    import h5py
    run, = sql(machine, "SELECT min(run_index) FROM run_result WHERE status = 1")[0]
    machine.run("replay", "a.db", "--run", run, "--output", "run.h5", "--force")
    num_signals = 0
    with h5py.File(machine.path("run.h5")) as file, proofmass.replay(machine.path("run.h5")) as own:
        assert own.attributes["run_index"] == run and own.attributes["status"] == "completed"
        assert set(own) == set(file)
        for session, groups in file.items():
            assert own[session].attributes["sample_rate_hz"] == groups.attrs["sample_rate_hz"]
            assert set(own[session]) == set(groups)
            for group, dataset in groups.items():
                series = own[session][group]
                assert tuple(series) == dataset.dtype.names
                for i, name in enumerate(dataset.dtype.names):
                    unit = dataset.attrs["units"][i]
                    unit = unit.decode() if isinstance(unit, bytes) else unit
                    assert series.units[name] == unit, (session, group, name)
                    assert numpy.array_equal(series[name], dataset[name]), (session, group, name)
                    num_signals += 1
    assert num_signals > 3, num_signals
    machine.run("export", "a.db", "--output", "export.h5", "--force")
    for name, reason in (("export.h5", "was not written by"), ("a.db", "file signature not found")):
        try:
            proofmass.replay(machine.path(name))
        except proofmass.CampaignError as error:
            assert reason in str(error) and name in str(error), error
        else:
            raise AssertionError(name)


def check_refusals(machine, proofmass):
    def refusal(*changes):
        copy = machine.path("copy.db")
        shutil.copy(machine.path("a.db"), copy)
        with sqlite3.connect(copy) as database:
            for change in changes:
                database.execute(change)
        database.close()
        try:
            proofmass.open(copy)
        except proofmass.CampaignError as error:
            return str(error)
        return ""
    file = f"campaign database = {machine.path('copy.db')} "
    assert refusal("PRAGMA application_id = 5").startswith(
        file + "(is not a Proofmass campaign: its application_id is 5, not "), "application_id"
    newer = refusal("PRAGMA user_version = 99")
    assert newer.startswith(file + "(is newer than this reader: its user_version is 99"), newer
    for mode in ("DELETE", "WAL"):  # With the latter, SQLite makes a new log.
        lacking = refusal(f"PRAGMA journal_mode = {mode}",
                          "UPDATE campaign SET is_log_needed = 1")
        assert lacking.startswith(file + "(lacks its log copy.db-wal: results may be missing"), (
            mode, lacking)
    for name, content in (("absent.db", None), ("text.db", b"no database" * 100)):
        if content:
            machine.path(name).write_bytes(content)
        try:
            proofmass.open(machine.path(name))
            raise AssertionError(f"{name} was opened")
        except proofmass.CampaignError as error:
            assert str(error).startswith(f"campaign database = {machine.path(name)} ("), error
    with proofmass.open(machine.path("a.db")) as campaign:
        try:
            campaign.draws("/nowhere/proofmass")
            raise AssertionError("draws without a program")
        except proofmass.CampaignError as error:
            assert str(error).startswith("/nowhere/proofmass: "), error
        try:
            campaign.query("DELETE FROM run_result")
            raise AssertionError("results could be deleted")
        except sqlite3.OperationalError:
            pass


def check_all(machine, has_pandas):
    if not has_pandas:
        sys.modules["pandas"] = None  # An import fails.
    sys.path.insert(0, str(DEPLOY))
    import numpy
    import proofmass
    assert (proofmass.pandas is not None) == has_pandas, "pandas"
    before = hashlib.sha256(machine.path("a.db").read_bytes()).digest()
    with proofmass.open(machine.path("a.db")) as campaign:
        check_identity(machine, campaign)
        num_lost = check_results(machine, campaign, numpy)
        check_accuracy(machine, campaign, numpy)
        check_draws(machine, campaign, numpy)
    check_unconverged(machine, proofmass, numpy)
    check_replay(machine, proofmass, numpy)
    check_refusals(machine, proofmass)
    after = hashlib.sha256(machine.path("a.db").read_bytes()).digest()
    assert before == after, "the database was changed"
    return num_lost


def check_example(machine):
    environment = {**os.environ, "MPLCONFIGDIR": str(machine.directory)}
    done = subprocess.run([PYTHON, str(DEPLOY / "example.py"), "a.db", "figures"], text=True,
                          cwd=machine.directory, env=environment, capture_output=True, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stderr == "", done.stderr
    for name in ("errors", "convergence", "correlation"):
        figure = machine.path(f"figures/{name}.png").read_bytes()
        assert figure.startswith(b"\x89PNG") and len(figure) > 5000, name
    report = machine.json("report", "a.db", "--json")["parameters"]
    for parameter in report:
        expected = f"{parameter['symbol']:10} worst {parameter['worst']:10.3g}  "
        assert expected in done.stdout, f"{expected}\n{done.stdout}"


def in_own_process(check, *arguments):
    """What one check imports, another must not find."""
    process = os.fork()
    if process == 0:
        code = 1
        try:
            check(*arguments)
            code = 0
        finally:
            sys.stdout.flush()
            sys.stderr.flush()
            if code:
                import traceback
                traceback.print_exc()
            os._exit(code)
    assert os.waitpid(process, 0)[1] == 0, "see above"


def main():
    parser = checking.parser_of(__doc__)
    parser.add_argument("--oscillator", type=Path, required=True,
                        help="directory of the programs with another model")
    arguments = parser.parse_args()
    if subprocess.run([PYTHON, "-c", f"import {', '.join(PACKAGES)}"], capture_output=True,
                      check=False).returncode != 0:
        checking.skip(f"no {' '.join(f'python3-{name}' for name in PACKAGES)} "
                      "(deploy/install-deps.sh installs them)")
    if os.path.realpath(sys.executable) != os.path.realpath(PYTHON):
        os.execv(PYTHON, [PYTHON, *sys.argv])
    sys.dont_write_bytecode = True
    os.environ["PYTHONDONTWRITEBYTECODE"] = "1"
    with tempfile.TemporaryDirectory(prefix="python_reader_check.") as directory:
        paper = microscope(arguments.programs.resolve(), Path(directory) / "microscope")
        other = oscillator(arguments.oscillator.resolve(), Path(directory) / "oscillator")
        num_lost = sql(paper, "SELECT count(*) FROM run_result WHERE status = 5")[0][0]
        assert 0 < num_lost < NUM_RUNS, f"{num_lost} runs are lost"
        for machine in (paper, other):
            for has_pandas in (True, False):
                in_own_process(check_all, machine, has_pandas)
            check_example(machine)
    print("the reader has the numbers of the program, of SQL and of h5py")
    return 0


if __name__ == "__main__":
    sys.exit(main())
