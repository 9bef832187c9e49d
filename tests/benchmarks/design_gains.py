#!/usr/bin/env python3
"""What sampling designs gain for a campaign: the runs after which the mean |error| of each parameter
is known to 2 % (95 %), with independent draws and with each design.

Usage: design_gains.py BIN_DIRECTORY CAMPAIGN.toml [--points 32] [--replicates 32] [--set KEY=VALUE ...]

Computes a campaign for each design with the programs and asks their databases in SQL. Independent
draws make the mean of N runs known to s/√N, s being the standard deviation of |error|; a design makes
the mean of R replicates known to S/√R, S being the standard deviation of the replicates' means. The
gain of a design is s²/(n S²) for n points a replicate. Its geometric mean over the parameters has the
standard error of a jackknife over the replicates.
"""

import argparse
import json
import math
import pathlib
import statistics
import subprocess
import tempfile

RELATIVE_ERROR = 0.02
NORMAL_95 = 1.96
DESIGNS = ("random", "latin_hypercube", "sobol")
MEANS = """SELECT parameter, avg(abs(error)) AS mean, avg(error * error) AS mean_square
    FROM error_long WHERE error IS NOT NULL GROUP BY parameter, run_index / {points}"""


def replicates_of(options, directory, design):
    """(mean |error|, mean error²) of each replicate, by parameter."""
    database = directory / f"{design}.db"
    # A design needs its number of points, and independent draws have none.
    points = [] if design == "random" else [f"campaign.points={options.points}"]
    settings = [f"campaign.design={design}", *points, *options.set]
    subprocess.run([options.binaries / "proofmass", "run", options.campaign, "--db", database,
                    "--runs", str(options.points * options.replicates), "--quiet",
                    *(word for setting in settings for word in ("--set", setting))],
                   stdout=subprocess.DEVNULL, check=True)
    answer = subprocess.run([options.binaries / "proofmass", "query", database, "--format", "json",
                             MEANS.format(points=options.points)],
                            capture_output=True, text=True, check=True)
    found = {}
    for row in json.loads(answer.stdout):
        found.setdefault(row["parameter"], []).append((row["mean"], row["mean_square"]))
    return found


def variance_of_a_run(replicates):
    """Of |error|, over all runs."""
    mean = statistics.fmean(of for of, _ in replicates)
    return statistics.fmean(of for _, of in replicates) - mean**2


def variance_of_a_replicate(replicates):
    """Of their means."""
    return statistics.variance(of for of, _ in replicates)


def geometric_gain(independent, design, points):
    logs = [math.log(independent[parameter] / (points * variance_of_a_replicate(replicates)))
            for parameter, replicates in design.items()]
    return math.exp(statistics.fmean(logs))


def jackknife_error(independent, design, points):
    count = len(next(iter(design.values())))
    gains = []
    for i in range(count):
        others = {parameter: of[:i] + of[i + 1:] for parameter, of in design.items()}
        gains.append(geometric_gain(independent, others, points))
    return math.sqrt((count - 1) * statistics.pvariance(gains))


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("binaries", type=pathlib.Path)
    parser.add_argument("campaign", type=pathlib.Path)
    parser.add_argument("--points", type=int, default=32, help="of a replicate; a power of two")
    parser.add_argument("--replicates", type=int, default=32)
    parser.add_argument("--set", action="append", default=[], help="as of `proofmass run`")
    options = parser.parse_args()
    options.binaries = options.binaries.resolve()
    with tempfile.TemporaryDirectory() as directory:
        found = {design: replicates_of(options, pathlib.Path(directory), design)
                 for design in DESIGNS}
    independent = {parameter: variance_of_a_run(of) for parameter, of in found["random"].items()}
    print("runs to know the mean |error| to 2 % (95 %)", *DESIGNS, sep="\t")
    for parameter, of_random in found["random"].items():
        mean = statistics.fmean(of for of, _ in of_random)
        variances = [independent[parameter]]
        variances += [options.points * variance_of_a_replicate(found[design][parameter])
                      for design in DESIGNS[1:]]
        needed = [math.ceil(of * (NORMAL_95 / (RELATIVE_ERROR * mean))**2) for of in variances]
        print(parameter, *needed, sep="\t")
    for design in DESIGNS[1:]:
        print(f"gain of {design}, geometric mean:",
              f"{geometric_gain(independent, found[design], options.points):.2f} ±",
              f"{jackknife_error(independent, found[design], options.points):.2f}")


if __name__ == "__main__":
    main()
