"""Reads campaign databases and replays of Proofmass.

    import proofmass

    campaign = proofmass.open("hardy2013.db")
    results = campaign.results()
    for quantity in campaign.quantities:
        print(quantity.symbol, abs(results[quantity.error]).max(), quantity.unit)

Needs numpy. Tables are pandas data frames if pandas is there, else dictionaries of arrays; replay()
needs h5py. Results are read with Python's sqlite3 alone; only Campaign.draws() starts a program,
because what a run draws is computed and not stored. All numbers are SI.
"""

import array
import collections
import collections.abc
import contextlib
import csv
import io
import pathlib
import sqlite3
import subprocess
import tempfile
import tomllib

import numpy

try:
    import pandas
except ImportError:
    pandas = None

__all__ = ["Campaign", "CampaignError", "Columns", "Quantity", "Replay", "Series", "Session",
           "open", "replay"]

APPLICATION_ID = 1349668211  # "PrMs".
SCHEMA_VERSION = 14  # The newest user_version that this reader knows.
OLDEST_SCHEMA_VERSION = 8  # There is no older one.
STATUSES = ("completed", "not_converged", "not_finite", "no_draw", "lost")  # 1 to 5 in run_result.
ROWS_AT_A_TIME = 8192

# Endings of the columns of tables and views, and the units that they stand for.
UNITS = {"m_s2": "m/s²", "s2_m": "s²/m", "rad_s2": "rad/s²", "rad_s": "rad/s", "rad": "rad",
         "m": "m", "s": "s", "hz": "Hz"}


class CampaignError(Exception):
    """A file is no campaign database or replay, or cannot be read completely."""


class Quantity(collections.namedtuple(
        "Quantity", "name symbol unit objective truth estimate error")):
    """A quantity that every run estimates.

    name        In SQL: `k2d`.
    symbol      For people: `K2d/K1c²`.
    unit        Of all its numbers: `s²/m`; `1` if it has none.
    objective   Largest acceptable |error|, or None.
    truth, estimate, error
                Names of its columns in results().
    """

    __slots__ = ()


class Columns(dict):
    """A table without pandas: arrays by the names of the columns. `units` has the unit of each."""

    def __init__(self, columns, units):
        super().__init__(columns)
        self.units = units


def _table(columns, units, index=None):
    if pandas is None:
        return Columns(columns, units)
    frame = pandas.DataFrame(columns)
    if index is not None:
        frame = frame.set_index(index)
    frame.attrs["units"] = units
    return frame


def open(file):  # As the file is opened: proofmass.open("a.db").
    """Opens a campaign database, of which nothing is changed. See Campaign."""
    return Campaign(file)


class Campaign:
    """A campaign database, also one that a coordinator is writing to.

    Each method reads one state of the file; results that arrive in between are in the next one.

    name, num_runs (asked for), model_version, build, created_utc, phase
    seed             An integer of 64 bits.
    digest           SHA-256 of the results when the statistics were stored; None before.
    definition       The campaign file, completed, as a dictionary. definition_text is its TOML.
    quantities       A list of Quantity.
    """

    def __init__(self, file):
        self.file = pathlib.Path(file)
        if not self.file.is_file():
            self._refuse("does not exist")
        try:
            self._connection = sqlite3.connect(f"{self.file.resolve().as_uri()}?mode=ro", uri=True,
                                               isolation_level=None)
            self._open()
        except sqlite3.Error as error:
            self._refuse(f"cannot be read: {error}")

    def __enter__(self):
        return self

    def __exit__(self, *exception):
        self.close()

    def close(self):
        self._connection.close()

    def results(self):
        """All finished runs, in their order.

        `run_index` (the index, with pandas), `status` as text, `num_draws`, `num_rounds`; for each
        quantity its truth, estimate and error = estimate − truth, see Quantity; the health of the
        control loops; `loss_cause` and `loss_session` of a lost run. NaN where there is no value.
        The units are in `results().attrs["units"]`, without pandas in `results().units`.
        """
        with self._one_state():
            names = [row[1] for row in self._rows("PRAGMA table_xinfo(run_result)")
                     if row[1] not in ("loss_cause", "loss_session", "correlations")]
            columns = self._arrays(f"SELECT {', '.join(map(_quoted, names))} FROM run_result "
                                   "ORDER BY run_index", names)
            losses = self._rows("SELECT run_index, loss_cause, loss_session FROM loop_health "
                                "WHERE loss_cause IS NOT NULL")
        texts = numpy.array(("",) + STATUSES, dtype=object)
        columns["status"] = texts[columns["status"]]
        for position, name in enumerate(("loss_cause", "loss_session"), start=1):
            columns[name] = numpy.full(len(columns["run_index"]), "", dtype=object)
            for loss in losses:
                row = numpy.searchsorted(columns["run_index"], loss[0])
                columns[name][row] = loss[position]
        return _table(columns, self._units_of(columns), "run_index")

    def accuracy(self):
        """Of |error| of each quantity, computed from the results that are in the file now.

        A row a quantity: `name`, `symbol`, `unit`, `objective`, `num_runs` (completed),
        `worst`, `worst_run`, `mean`, `standard_deviation` (with n − 1), `num_beyond` (runs whose
        |error| is above the objective).
        """
        columns = [quantity.error for quantity in self.quantities]
        errors = self._arrays(
            f"SELECT run_index, {', '.join(map(_quoted, columns))} FROM run_result "
            "WHERE status = 1 ORDER BY run_index", ["run_index", *columns])
        rows = [self._accuracy_of(quantity, errors) for quantity in self.quantities]
        return _table({name: numpy.array([row[name] for row in rows]) for name in rows[0]}, {},
                      "name")

    def statistics(self):
        """The view `parameter_accuracy`: what the program computed of each quantity when the
        campaign ended or was stopped, with 95 % intervals (`_lower`, `_upper`), as
        coordinator/store/README.md describes it. NaN before that."""
        return self.query("SELECT * FROM parameter_accuracy", "parameter")

    def draws(self, program="proofmass"):
        """What each run drew: `run_index` and a column for each drawn quantity. NaN for a run whose
        draws were all rejected. Join it with results() by the index, or without pandas by
        `run_index`, which both have in the same order.

        The values are not in the file: `program` computes them again, bit for bit.
        """
        runs, values, units = array.array("q"), {}, {}
        sql = "SELECT run_index, quantity, unit, value FROM run_result JOIN draw USING (run_index)"
        with self._lines_of(program, "query", sql, "--format", "csv", "--timeout", "86400") as lines:
            next(lines)
            for run, quantity, unit, value in lines:
                if not runs or int(run) != runs[-1]:
                    runs.append(int(run))
                units[quantity] = unit
                values.setdefault(quantity, array.array("d")).append(float(value or "nan"))
        columns = {"run_index": numpy.array(runs, dtype=numpy.int64)}
        columns |= {quantity: numpy.array(column) for quantity, column in values.items()}
        return _table(columns, units, "run_index")

    def query(self, sql, index=None):
        """The rows of a statement in SQL, with the tables and views of coordinator/store/README.md.
        `index` names the column that is the index with pandas."""
        with self._one_state():
            cursor = self._connection.execute(sql)
            names = [column[0] for column in cursor.description]
            rows = cursor.fetchall()
        columns = {name: _array([row[i] for row in rows]) for i, name in enumerate(names)}
        return _table(columns, self._units_of(columns), index)

    def _open(self):
        # A schema from elsewhere calls no function with side effects.
        for setting in ("trusted_schema = OFF", "query_only = ON", "cell_size_check = ON",
                        "busy_timeout = 5000"):
            self._connection.execute(f"PRAGMA {setting}")
        application_id, = self._row("PRAGMA application_id")
        if application_id != APPLICATION_ID:
            self._refuse(f"is not a Proofmass campaign: its application_id is {application_id}, "
                         f"not {APPLICATION_ID}")
        version, = self._row("PRAGMA user_version")
        if version > SCHEMA_VERSION:
            self._refuse(f"is newer than this reader: its user_version is {version}, at most "
                         f"{SCHEMA_VERSION} is known")
        if version < OLDEST_SCHEMA_VERSION:
            self._refuse(f"was made before the first release: its user_version is {version}")
        self._check_that_log_is_there()
        (self.name, seed, self.num_runs, self.definition_text, self.model_version, self.build,
         self.created_utc, self.phase) = self._row(
            "SELECT name, seed, num_runs, definition, model_version, build, created_utc, phase "
            "FROM campaign")
        self.seed = int(seed)
        self.definition = tomllib.loads(self.definition_text)
        summary = self._rows("SELECT digest FROM summary")
        self.digest = summary[0][0] if summary else None
        self.quantities = self._read_quantities()

    def _check_that_log_is_there(self):
        file = self.file.resolve()
        log = file.with_name(file.name + "-wal")

        def is_log_there():
            try:
                # SQLite makes an empty one where it finds none. Headers alone are 56 bytes.
                return log.stat().st_size > 56
            except FileNotFoundError:
                return False

        def lacks_log():
            return self._row("SELECT is_log_needed FROM campaign")[0] and not is_log_there()

        # The log comes and goes while a coordinator works.
        if lacks_log() and lacks_log():
            self._refuse(f"lacks its log {log.name}: results may be missing; copy both files, or "
                         "make copies with `proofmass backup`")

    def _read_quantities(self):
        names = [row[1] for row in self._rows("PRAGMA table_xinfo(run_result)")]
        # The columns of each kind have the order of the quantities.
        columns = [[name for name in names if name.startswith(kind)]
                   for kind in ("truth_", "estimate_", "error_")]
        rows = self._rows("SELECT parameter, label, unit, objective FROM parameter "
                          "ORDER BY position")
        quantities = [Quantity(*row, *of_kinds) for row, of_kinds in zip(rows, zip(*columns))]
        if len(quantities) != len(rows) or not all(
                quantity.truth.startswith(f"truth_{quantity.name}") for quantity in quantities):
            self._refuse("is damaged: its results are not those of its parameters")
        return quantities

    def _accuracy_of(self, quantity, errors):
        magnitudes = numpy.abs(errors[quantity.error])
        count = len(magnitudes)
        worst = int(numpy.argmax(magnitudes)) if count else None
        objective = numpy.inf if quantity.objective is None else quantity.objective
        return {"name": quantity.name, "symbol": quantity.symbol, "unit": quantity.unit,
                "objective": objective, "num_runs": count,
                "worst": magnitudes[worst] if count else numpy.nan,
                "worst_run": errors["run_index"][worst] if count else -1,
                "mean": magnitudes.mean() if count else numpy.nan,
                "standard_deviation": magnitudes.std(ddof=1) if count > 1 else numpy.nan,
                "num_beyond": int((magnitudes > objective).sum())}

    def _units_of(self, columns):
        units = {}
        for quantity in self.quantities:
            units |= dict.fromkeys((quantity.truth, quantity.estimate, quantity.error),
                                   quantity.unit)
        for name in columns:
            if name in units or columns[name].dtype.kind != "f":
                continue
            units[name] = next((unit for ending, unit in UNITS.items()
                                if name.endswith("_" + ending)), "1")
        return {name: unit for name, unit in units.items() if name in columns}

    def _arrays(self, sql, names):
        """Columns as arrays, read in blocks: a million runs take no more than their numbers."""
        blocks = {name: [] for name in names}
        cursor = self._connection.execute(sql)
        while rows := cursor.fetchmany(ROWS_AT_A_TIME):
            for name, values in zip(names, zip(*rows)):
                blocks[name].append(numpy.array(values, dtype=_kind_of(name)))
        return {name: numpy.concatenate(parts) if parts else numpy.empty(0, _kind_of(name))
                for name, parts in blocks.items()}

    @contextlib.contextmanager
    def _lines_of(self, program, command, *options):
        """The lines of a CSV that a program prints, while it prints them."""
        words = [program, command, str(self.file.resolve()), *options]
        with tempfile.TemporaryFile("w+", errors="replace") as errors:
            try:
                process = subprocess.Popen(words, stdout=subprocess.PIPE, stderr=errors)
            except OSError as error:
                raise CampaignError(
                    f"{program}: {error.strerror} (the draws are computed by it)") from error
            with process:
                output = io.TextIOWrapper(process.stdout, encoding="utf-8", newline="")
                try:
                    yield csv.reader(output)
                except StopIteration:
                    pass  # It printed nothing, and says why.
            if process.returncode != 0:
                errors.seek(0)
                raise CampaignError(errors.read().strip())

    def _one_state(self):
        return _Transaction(self._connection)

    def _rows(self, sql):
        return self._connection.execute(sql).fetchall()

    def _row(self, sql):
        row = self._connection.execute(sql).fetchone()
        if row is None:
            self._refuse("is damaged: it names no campaign")
        return row

    def _refuse(self, why):
        raise CampaignError(f"campaign database = {self.file} ({why})") from None


class _Transaction:
    """Statements within it read one state of the file."""

    def __init__(self, connection):
        self._connection = connection

    def __enter__(self):
        self._connection.execute("BEGIN")

    def __exit__(self, *exception):
        self._connection.execute("ROLLBACK")


def _kind_of(name):
    is_whole = name in ("run_index", "status", "num_draws", "num_rounds")
    return numpy.int64 if is_whole else numpy.float64


def _quoted(name):
    return '"' + name.replace('"', '""') + '"'


def _array(values):
    """Numbers with NaN for NULL; texts as objects."""
    kinds = {type(value) for value in values}
    if kinds <= {int} and kinds:
        return numpy.array(values, dtype=numpy.int64)
    if kinds <= {int, float, type(None)}:
        return numpy.array([numpy.nan if value is None else value for value in values],
                           dtype=numpy.float64)
    return numpy.array(values, dtype=object)


def replay(file):
    """Opens a file that `proofmass replay --output FILE.h5` wrote. See Replay."""
    return Replay(file)


class _Named(collections.abc.Mapping):
    """Named parts, in the order of their names."""

    def __init__(self, parts, attributes):
        self._parts = parts
        self.attributes = attributes

    def __getitem__(self, name):
        return self._parts[name]

    def __iter__(self):
        return iter(self._parts)

    def __len__(self):
        return len(self._parts)


class Replay(_Named):
    """The time series of one run: `replay("run42.h5")["a_c13"]["modes"]["differential_x"]`.

    A mapping of the sessions, see Session. `attributes` has what the file says of itself, such as
    `run_index`, `status`, `seed`, `build` and `definition`. Samples are read from the file when
    they are asked for; close() or `with` ends that.
    """

    def __init__(self, file):
        import h5py  # Only replays need it.
        try:
            self._file = h5py.File(file, "r")
        except OSError as error:
            raise CampaignError(f"replay = {file} ({error})") from None
        if "run_index" not in self._file.attrs:
            self._file.close()
            raise CampaignError(f"replay = {file} (was not written by `proofmass replay`)")
        super().__init__({name: Session(group) for name, group in self._file.items()},
                         _attributes(self._file))

    def __enter__(self):
        return self

    def __exit__(self, *exception):
        self.close()

    def close(self):
        self._file.close()


class Session(_Named):
    """A session of a replayed run: a mapping of its groups of signals, see Series.
    `attributes["sample_rate_hz"]` is their sample rate."""

    def __init__(self, group):
        super().__init__({name: Series(dataset) for name, dataset in group.items()},
                         _attributes(group))


class Series(collections.abc.Mapping):
    """A group of signals: arrays by name, `time` in seconds from the start of the session among
    them. `units`, `frames` and `meanings` have a text for each signal."""

    def __init__(self, dataset):
        self._dataset = dataset
        self.attributes = _attributes(dataset)
        names = dataset.dtype.names
        self.units, self.frames, self.meanings = (
            dict(zip(names, self.attributes.get(name, ())))
            for name in ("units", "frames", "meanings"))

    def __getitem__(self, name):
        if name not in self._dataset.dtype.names:
            raise KeyError(name)
        return self._dataset.fields(name)[()]

    def __iter__(self):
        return iter(self._dataset.dtype.names)

    def __len__(self):
        return len(self._dataset.dtype.names)

    def table(self):
        """All signals as one table."""
        samples = self._dataset[()]
        return _table({name: samples[name] for name in self}, dict(self.units), "time")


def _attributes(item):
    return {name: _plain(value) for name, value in item.attrs.items()}


def _plain(value):
    if isinstance(value, bytes):
        return value.decode()
    if isinstance(value, numpy.ndarray):
        return [_plain(element) for element in value]
    return value.item() if isinstance(value, numpy.generic) else value
