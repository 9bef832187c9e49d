"""Runs campaigns of proofmass with an instrument of one's own, in Python.

    class Oscillator(proofmass_model.Model):
        name, version = "oscillator", "1"
        ...
        def run(self, parameters, drawn, random):
            return {"in_phase": estimate}

    if __name__ == "__main__":
        Oscillator().serve()

and then `proofmass run mine.toml --model-program ./oscillator.py`. oscillator.py beside this file is
a whole example. Needs the standard library only.
"""

import json
import math
import os
import random as standard_random
import sys
import traceback


class Refused(Exception):
    """A parameter has a value that the model cannot work with."""

    def __init__(self, name, rule):
        super().__init__(f"{name}: {rule}")
        self.name = name
        self.rule = rule


class Random:
    """Random numbers of one run, the same whenever and wherever it is computed."""

    def __init__(self, seeds):
        self._seeds = seeds

    def seed(self, stream):
        """The 128-bit seed of a stream that `streams` names: for numpy.random.default_rng(), say."""
        if stream not in self._seeds:
            raise KeyError(f"no stream {stream!r}: the model's `streams` must name it")
        return int(self._seeds[stream], 16)

    def stream(self, stream):
        """Its numbers, as of random.Random."""
        return standard_random.Random(self.seed(stream))


class Model:
    """What is measured. Set these, and define run()."""

    name = "mine"
    version = "1"  # Must change with what may change a result.
    purpose = None  # A sentence, the first of `proofmass --help`.
    parameters = {}  # Name: number that all runs of a campaign share, unless its file has another.
    drawn = {}  # Name: law of what is drawn for each run, see uniform() and normal().
    quantities = {}  # Name: quantity() that each run estimates.
    streams = ("noise",)  # Of random numbers.
    runs_at_once = 16  # That a worker takes together; fewer if a run takes many seconds.
    run_time_max_s = 600  # After which a run counts as crashed.
    memory_max_mib = 4096  # More than that cannot be had.

    def check(self, parameters):
        """Raises Refused if the parameters make no sense."""

    def run(self, parameters, drawn, random):
        """Simulates a run and estimates what its quantities are.

        Returns {quantity: estimate}, or also {quantity: standard error} as a second value; None if
        the run is lost. It is lost, too, if an ArithmeticError, ValueError or RuntimeError is
        raised, which are those of numbers; any other error ends the program. `parameters` and `drawn` are dictionaries of numbers in SI units, `random`
        is a Random. The result must follow from these alone.
        """
        raise NotImplementedError

    def serve(self):
        """Answers the questions of proofmass until there are no more."""
        answers = os.fdopen(os.dup(1), "w", encoding="utf-8")
        os.dup2(2, 1)  # What the model prints is no answer.
        sys.stdin.reconfigure(encoding="utf-8")
        try:
            for line in sys.stdin:
                question = json.loads(line)
                answers.write(json.dumps(getattr(self, "_" + question["ask"])(question)) + "\n")
                answers.flush()
        except (BrokenPipeError, KeyboardInterrupt):
            os._exit(1)  # Nobody waits for an answer any more.

    def _describe(self, _):
        description = {
            "proofmass_model_program": 1,
            "name": self.name,
            "version": self.version,
            "parameters": [{"name": n, "value": float(v)} for n, v in self.parameters.items()],
            "drawn": [{"name": n, **law} for n, law in self.drawn.items()],
            "quantities": [{"name": n, **q} for n, q in self.quantities.items()],
            "streams": [{"name": n} for n in self.streams],
            "runs_at_once": self.runs_at_once,
            "run_time_max_s": self.run_time_max_s,
            "memory_max_mib": self.memory_max_mib,
        }
        if self.purpose is not None:
            description["purpose"] = self.purpose
        return description

    def _prepare(self, question):
        self._parameters = question["parameters"]
        try:
            self.check(self._parameters)
        except Refused as refused:
            return {"refused": refused.name, "rule": refused.rule}
        return {}

    def _run(self, question):
        return {"run": question["run"], **self._result_of(question)}

    def _result_of(self, question):
        drawn = question["drawn"]
        try:
            result = self.run(self._parameters, drawn, Random(question["seeds"]))
            if result is None:
                return {"lost": True}
            estimate, errors = result if isinstance(result, tuple) else (result, {})
            if not isinstance(estimate, dict) or not isinstance(errors, dict):
                raise TypeError(
                    "run() must return {quantity: estimate}, such a dictionary and one of standard "
                    f"errors, or None, and not {result!r}")
            return {"estimate": _finite(estimate), "standard_error": _finite(errors)}
        except Exception as error:
            is_of_run = (isinstance(error, (ArithmeticError, ValueError, RuntimeError))
                         and not isinstance(error, NotImplementedError))
            print(f"model {self.name}: run {question['run']} "
                  f"{'is lost' if is_of_run else 'ends the program'}; it drew {drawn}",
                  file=sys.stderr)
            if not is_of_run:
                raise
            traceback.print_exc()
            return {"lost": True}


def _finite(values):
    """JSON has no infinities and no NaN: they become null."""
    numbers = {name: float(value) for name, value in values.items()}
    return {name: value if math.isfinite(value) else None for name, value in numbers.items()}


def uniform(minimum, maximum, unit="1"):
    """A law of `drawn`."""
    return {"law": "uniform", "minimum": minimum, "maximum": maximum, "unit": unit}


def normal(mean, standard_deviation, unit="1"):
    """A law of `drawn`."""
    return {"law": "normal", "mean": mean, "standard_deviation": standard_deviation, "unit": unit}


def fixed(value, unit="1"):
    """A law of `drawn`: the same in all runs, unless a campaign has another law."""
    return {"law": "fixed", "value": value, "unit": unit}


def discrete(values, probabilities, unit="1"):
    """A law of `drawn`: one of these values."""
    return {"law": "discrete", "values": list(values), "probabilities": list(probabilities),
            "unit": unit}


def derived(expression, unit="1"):
    """A law of `drawn`: an expression of other drawn quantities, as the truth of quantity()."""
    return {"law": "derived", "expression": expression, "unit": unit}


def correlated(mean, standard_deviation, correlations, unit="1"):
    """A law of `drawn`: normal, with correlations {name: value} with normal ones before it."""
    return {"law": "correlated", "mean": mean, "standard_deviation": standard_deviation,
            "with": list(correlations), "correlations": list(correlations.values()), "unit": unit}


def quantity(truth, unit="1", objective=None, standard_error=False, symbol=None, display_unit=None,
             display_scale=None):
    """What each run estimates.

    `truth` is its true value as an expression of drawn quantities and parameters: + - * /,
    parentheses, sqrt(x) and pow(x, n). `objective` is the largest acceptable error, in `unit`.
    `standard_error` says that run() returns one. Tables call it `symbol` and show
    value / display_scale in display_unit.
    """
    optional = {"objective": objective, "symbol": symbol, "display_unit": display_unit,
                "display_scale": display_scale}
    return {"truth": truth, "unit": unit, "standard_error": standard_error,
            **{name: value for name, value in optional.items() if value is not None}}
