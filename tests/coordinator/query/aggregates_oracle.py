"""Confirms the aggregates of the SQLite extension by numpy, scipy and mpmath.

Loads the extension into Python's own SQLite, fills tables with columns of several kinds, in several
orders, and compares what SQL says with an exact computation. Needs the Debian packages
python3-scipy and python3-mpmath.

Usage: aggregates_oracle.py proofmass_sqlite.so
"""

import random
import sqlite3
import sys
from fractions import Fraction

try:
    import mpmath
    import numpy as np
    import scipy.stats
except ImportError as error:
    sys.exit(f"aggregates_oracle: {error} (install python3-scipy and python3-mpmath)")

mpmath.mp.dps = 40
TOLERANCE = 1e-12  # Relative.
num_confirmed = 0


def real(fraction):
    return mpmath.mpf(fraction.numerator) / mpmath.mpf(fraction.denominator)


def central_sums(values):
    """Exact sums of the squares and cubes of what the values differ from their mean."""
    values = [Fraction(v) for v in values]
    n, s1 = len(values), sum(values)
    s2, s3 = sum(v * v for v in values), sum(v**3 for v in values)
    mean = s1 / n
    return s2 - n * mean**2, s3 - 3 * mean * s2 + 2 * n * mean**3


def stdev(values):
    return mpmath.sqrt(real(central_sums(values)[0]) / (len(values) - 1))


def skewness(values):
    squares, cubes = map(real, central_sums(values))
    n = mpmath.mpf(len(values))
    return mpmath.sqrt(n * (n - 1)) / (n - 2) * (cubes / n) / (squares / n) ** mpmath.mpf(1.5)


def kurtosis(values):
    values = [Fraction(v) for v in values]
    n, mean = len(values), sum(values) / len(values)
    m2, m4 = sum((v - mean) ** 2 for v in values), sum((v - mean) ** 4 for v in values)
    plain = n * m4 / m2**2 - 3
    return real(Fraction(n - 1, (n - 2) * (n - 3)) * ((n + 1) * plain + 6))


def regression(y, x):
    x, y = [Fraction(v) for v in x], [Fraction(v) for v in y]
    n, x_mean, y_mean = len(x), sum(x) / len(x), sum(y) / len(y)
    slope = sum((a - x_mean) * (b - y_mean) for a, b in zip(x, y))
    slope /= sum((a - x_mean) ** 2 for a in x)
    return real(slope), real(y_mean - slope * x_mean)


def correlation(x, y):
    x, y = [Fraction(v) for v in x], [Fraction(v) for v in y]
    n = len(x)
    xy = sum(a * b for a, b in zip(x, y)) - sum(x) * sum(y) / n
    xx = sum(a * a for a in x) - sum(x) ** 2 / n
    yy = sum(b * b for b in y) - sum(y) ** 2 / n
    return real(xy) / mpmath.sqrt(real(xx) * real(yy))


def rank_correlation(x, y):
    return correlation(scipy.stats.rankdata(x), scipy.stats.rankdata(y))


def wilks_upper(values, coverage, confidence):
    """The value of the largest order k with P(Bin(n, 1 - coverage) < k) <= 1 - confidence."""
    n, k = len(values), 0
    while k < n and scipy.stats.binom.cdf(k, n, 1 - coverage) <= 1 - confidence:
        k += 1
    return None if k == 0 else sorted(values)[n - k]


def confirm(what, found, expected, tolerance=TOLERANCE):
    global num_confirmed
    num_confirmed += 1
    if expected is None or found is None:
        if found is not expected:
            sys.exit(f"{what}: {found} instead of {expected}")
        return
    if abs(found - expected) > tolerance * abs(expected):
        sys.exit(f"{what}: {found!r} instead of {mpmath.nstr(mpmath.mpf(expected), 20)}")


def columns():
    rng = np.random.default_rng(5)
    normal = rng.normal(size=2000)
    noisy = 0.6 * normal + rng.normal(size=2000)
    yield "normal", normal, noisy
    yield "offset", 1e8 + 2e-4 * normal, -1e8 + 2e-4 * noisy
    yield "skewed", np.exp(normal), np.exp(noisy)
    yield "equal values", np.round(2 * normal), np.round(2 * noisy)
    yield "tiny", 1e-13 + 1e-12 * normal, 1e-12 * noisy
    yield "few", normal[:70], noisy[:70]


def check(connection, name, x, y):
    x, y = [float(v) for v in x], [float(v) for v in y]
    connection.execute("DROP TABLE IF EXISTS t")
    connection.execute("CREATE TABLE t (x REAL, y REAL) STRICT")
    rows = list(zip(x, y)) + [(None, 1.0), (1.0, None)]
    connection.executemany("INSERT INTO t VALUES (?, ?)", random.sample(rows, len(rows)))

    def ask(function):
        answers = set()
        for order in ("rowid", "-rowid", "x", "y"):
            sql = f"SELECT {function} FROM (SELECT * FROM t WHERE y IS NOT NULL ORDER BY {order})"
            answers.add(connection.execute(sql).fetchone()[0])
        if len(answers) != 1:
            sys.exit(f"{name} {function}: {answers} in several orders")
        return answers.pop()

    confirm(f"{name} stdev", ask("stdev(x)"), stdev(x))
    # Of a symmetric law it is a difference of large sums: its size is 1.
    confirm(f"{name} skewness", 1 + ask("skewness(x)"), 1 + skewness(x))
    confirm(f"{name} correlation", ask("correlation(x, y)"), correlation(x, y))
    confirm(f"{name} rank_correlation", ask("rank_correlation(x, y)"), rank_correlation(x, y))
    # Of a normal law it is a difference from 3: its size is 1.
    confirm(f"{name} kurtosis", 1 + ask("kurtosis(x)"), 1 + kurtosis(x))
    confirm(f"{name} kurtosis of scipy", 1 + ask("kurtosis(x)"),
            1 + scipy.stats.kurtosis(np.array(x) - np.mean(x), bias=False), 1e-6)
    confirm(f"{name} median", ask("median(x)"), float(np.median(x)))
    slope, intercept = regression(y, x)
    confirm(f"{name} regr_slope", ask("regr_slope(y, x)"), slope)
    confirm(f"{name} regr_intercept", ask("regr_intercept(y, x)"), intercept)
    confirm(f"{name} corr", ask("corr(y, x)"), correlation(x, y))
    for percent in (0, 2.5, 50, 95, 99, 100):
        # A weighted mean of two values: its scale is theirs.
        expected = float(np.percentile(x, percent))
        confirm(f"{name} {percent} %", ask(f"percentile(x, {percent})"), expected)
    for coverage, confidence in ((0.95, 0.95), (0.5, 0.99), (0.99, 0.95), (0.99, 0.5)):
        found = ask(f"wilks_upper(x, {100 * coverage}, {100 * confidence}) FILTER (WHERE x IS NOT NULL)")
        confirm(f"{name} wilks_upper", found, wilks_upper(x, coverage, confidence), 0.0)


def check_binomial_intervals(connection):
    """Clopper and Pearson's bounds are quantiles of beta laws."""
    for hits, runs in ((0, 1), (1, 2), (3, 100), (97, 100), (100, 100), (7, 100000), (50000, 100000)):
        for confidence in (50, 90, 95, 99.9):
            tail = 0.5 - 0.5 * (confidence / 100)
            lower, upper = connection.execute(
                "SELECT binomial_interval_lower(?1, ?2, ?3), binomial_interval_upper(?1, ?2, ?3)",
                (hits, runs, confidence)).fetchone()
            test = scipy.stats.beta
            exact = (test.ppf(tail, hits, runs - hits + 1) if hits else 0.0,
                     test.ppf(1 - tail, hits + 1, runs - hits) if hits < runs else 1.0)
            confirm(f"{hits} of {runs}, lower, {confidence} %", lower, exact[0])
            confirm(f"{hits} of {runs}, upper, {confidence} %", upper, exact[1])


connection = sqlite3.connect(":memory:")
connection.enable_load_extension(True)
connection.load_extension(sys.argv[1])
for case in columns():
    check(connection, *case)
check_binomial_intervals(connection)
print(f"all {num_confirmed} confirmed")
