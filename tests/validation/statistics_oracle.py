"""Confirms statistics that statistics_oracle_test.cpp computed, by numpy, scipy and mpmath.

Reads columns and lines `function argument... : value...`, all numbers hexadecimal, computes every
value anew and compares. Sums over columns are exact here (integers), so that an offset of 1e8 costs
nothing. Needs the Debian packages python3-scipy and python3-mpmath.
"""

import math
import sys

try:
    import mpmath
    import numpy as np
    import scipy.special
    import scipy.stats
except ImportError as error:
    sys.exit(f"statistics_oracle: {error} (install python3-scipy and python3-mpmath)")

mpmath.mp.dps = 40

TOLERANCE = 1e-12  # Relative.
TOLERANCE_OF_A_BILLION = 5e-11  # Runs: Boost.Math loses digits of the largest parameters.

columns = {}


# ---- exact sums -----------------------------------------------------------------------------------


def integers(values):
    """The values as integers over one common power of two."""
    ratios = [float(v).as_integer_ratio() for v in values]
    denominator = max(d for _, d in ratios)
    return [n * (denominator // d) for n, d in ratios], denominator


def rational(numerator, denominator):
    return mpmath.mpf(numerator) / mpmath.mpf(denominator)


def exact_moments(values):
    x, unit = integers(values)
    n = len(x)
    s1, s2, s3, s4 = (sum(v**power for v in x) for power in range(1, 5))
    mean = rational(s1, n * unit)
    # n² Σ(x − mean)², n³ Σ(x − mean)³ / n and n⁴ Σ(x − mean)⁴ / n are integers.
    m2 = rational(n * s2 - s1 * s1, n * n * unit**2)
    m3 = rational(n * n * s3 - 3 * n * s1 * s2 + 2 * s1**3, n**3 * unit**3)
    deviation = mpmath.sqrt(m2 * n / (n - 1))
    rms = mpmath.sqrt(rational(s2, n * unit**2))
    skewness = mpmath.sqrt(n * (n - 1)) / (n - 2) * m3 / m2**1.5
    m4 = rational(n**3 * s4 - 4 * n * n * s1 * s3 + 6 * n * s1 * s1 * s2 - 3 * s1**4,
                  n**4 * unit**4)
    kurtosis = mpmath.mpf(n - 1) / ((n - 2) * (n - 3)) * ((n + 1) * (m4 / m2**2 - 3) + 6)
    return mean, deviation, rms, skewness, kurtosis


def exact_correlation(x, y):
    x, _ = integers(x)
    y, _ = integers(y)
    n = len(x)
    xy = n * sum(a * b for a, b in zip(x, y)) - sum(x) * sum(y)
    xx = n * sum(a * a for a in x) - sum(x) ** 2
    yy = n * sum(b * b for b in y) - sum(y) ** 2
    return mpmath.mpf(xy) / mpmath.sqrt(mpmath.mpf(xx) * mpmath.mpf(yy))


def student_quantile(probability, degrees):
    """scipy's own is only good to 1e-8; refined by the exact density."""
    probability, degrees = mpmath.mpf(probability), mpmath.mpf(degrees)
    start = scipy.stats.t.ppf(float(probability), float(degrees))
    scale = mpmath.exp(mpmath.loggamma((degrees + 1) / 2) - mpmath.loggamma(degrees / 2))
    scale /= mpmath.sqrt(degrees * mpmath.pi)

    def density(t):
        return scale * mpmath.exp(-(degrees + 1) / 2 * mpmath.log1p(t * t / degrees))

    # From the nearer end: ∞ for the tails.
    side = mpmath.sign(start) or 1
    tail = min(probability, 1 - probability)
    for _ in range(3):
        ends = [abs(start), 2 * abs(start) + 1, 8 * abs(start) + 4, mpmath.inf]
        start += side * (mpmath.quad(density, ends) - tail) / density(start)
    return start


# ---- functions of one column ----------------------------------------------------------------------


def moments(name):
    return exact_moments(columns[name])


def percentile(name, level):
    return [np.percentile(columns[name], 100.0 * float(level))]


def ranks(name):
    return scipy.stats.rankdata(columns[name])


def mean_interval(name, confidence):
    mean, deviation, *_ = exact_moments(columns[name])
    n = len(columns[name])
    half = student_quantile(0.5 + 0.5 * float(confidence), n - 1) * deviation / math.sqrt(n)
    return mean - half, mean + half


def deviation_interval(name, confidence):
    _, deviation, _, _, kurtosis = exact_moments(columns[name])
    n = mpmath.mpf(len(columns[name]))
    z = mpmath.mpf(scipy.stats.norm.ppf(0.5 + 0.5 * float(confidence)))
    c = n / (n - z)
    half = z * c * mpmath.sqrt((3 + kurtosis - (n - 3) / n) / (n - 1))
    return [deviation * mpmath.sqrt(c * mpmath.exp(sign * half)) for sign in (-1, 1)]


def lower_bound(ascending, level, confidence):
    """One-sided interpolated order statistic, Nyblom 1992; None if there is none."""
    n = len(ascending)
    holds = [r for r in range(1, n + 1) if scipy.stats.binom.sf(r - 1, n, level) >= confidence]
    if not holds:
        return None
    r = max(holds)
    high = scipy.stats.binom.sf(r - 1, n, level)
    low = scipy.stats.binom.sf(r, n, level)
    if r == n:
        return ascending[-1]
    ratio = r * (1 - level) * (confidence - low) / ((n - r) * level * (high - confidence))
    weight = 1 / (1 + ratio)
    return (1 - weight) * ascending[r - 1] + weight * ascending[r]


def percentile_interval(name, level, confidence):
    ascending = np.sort(columns[name])
    one_sided = 0.5 + 0.5 * float(confidence)
    if len(ascending) > 2000:  # The search above is linear; large columns are shifted copies.
        return None
    lower = lower_bound(ascending, float(level), one_sided)
    upper = lower_bound(-ascending[::-1], 1 - float(level), one_sided)
    return [] if lower is None or upper is None else [lower, -upper]


def philox(counter, key):
    """Philox4x32-10 of Salmon et al. 2011; four arrays of 32-bit words in 64 bits."""
    low = np.uint64(0xFFFFFFFF)
    c = [np.asarray(word, dtype=np.uint64) for word in counter]
    k = [key & 0xFFFFFFFF, key >> 32]
    for _ in range(10):
        a = np.uint64(0xD2511F53) * c[0]
        b = np.uint64(0xCD9E8D57) * c[2]
        c = [(b >> np.uint64(32)) ^ c[1] ^ np.uint64(k[0]), b & low,
             (a >> np.uint64(32)) ^ c[3] ^ np.uint64(k[1]), a & low]
        k = [(k[0] + 0x9E3779B9) & 0xFFFFFFFF, (k[1] + 0xBB67AE85) & 0xFFFFFFFF]
    return c


def stream_id(name):
    value = 0x811C9DC5
    for byte in name.encode():
        value = ((value ^ byte) * 0x01000193) & 0xFFFFFFFF
    return value


def resample_choices(num_resamples, num_groups):
    resample, block = np.meshgrid(np.arange(num_resamples), np.arange((num_groups + 3) // 4),
                                  indexing="ij")
    words = philox([block, np.full_like(block, stream_id("statistics/bootstrap")), resample,
                    np.zeros_like(block)], 1987)
    words = np.stack(words, axis=-1).reshape(num_resamples, -1)[:, :num_groups]
    return ((words * np.uint64(num_groups)) >> np.uint64(32)).astype(np.int64)


def bootstrap_deviation_interval(name, confidence):
    """BCa interval, Efron 1987 and 1993 (14.10) to (14.15)."""
    values = columns[name]
    n = len(values)
    num_groups = min(n, 1024)
    difference = values - float(exact_moments(values)[0])
    edges = [g * n // num_groups for g in range(num_groups + 1)]
    parts = [difference[a:b] for a, b in zip(edges, edges[1:])]
    sums = np.array([[len(p), p.sum(), (p * p).sum()] for p in parts])

    def deviation(s):
        return np.sqrt((s[..., 2] - s[..., 1] ** 2 / s[..., 0]) / (s[..., 0] - 1))

    total = sums.sum(axis=0)
    estimate = deviation(total)
    resamples = deviation(sums[resample_choices(1000, num_groups)].sum(axis=1))
    bias = scipy.stats.norm.ppf(np.mean(resamples < estimate))
    left_out = deviation(total - sums)
    spread = left_out.mean() - left_out
    rate = (spread**3).sum() / (6 * (spread**2).sum() ** 1.5)
    tail = 0.5 - 0.5 * float(confidence)
    shifted = bias + scipy.stats.norm.ppf([tail, 1 - tail])
    return np.quantile(resamples, scipy.stats.norm.cdf(bias + shifted / (1 - rate * shifted)))


# ---- functions of two columns ---------------------------------------------------------------------


def linear_correlation(x, y):
    return (exact_correlation(columns[x], columns[y]),)


def rank_correlation(x, y):
    return (exact_correlation(ranks(x), ranks(y)),)


def first_order_index(x, y, confidence):
    order = np.argsort(columns[x], kind="stable")
    ranked = columns[y][order]
    mean = exact_moments(columns[y])[0]
    y = [mpmath.mpf(float(v)) - mean for v in ranked]
    n = len(y)
    # Five equal inputs or more are a part, unless five values do not remain beside them.
    levels = np.flatnonzero(np.diff(np.sort(columns[x]))) + 1
    runs = list(zip([0, *levels], [*levels, n]))
    parts = [0]
    for at in sorted({place for a, b in runs if b - a >= 5 for place in (a, b)}):
        if at - parts[-1] >= 5 and n - at >= 5:
            parts.append(at)
    parts = [y[a:b] for a, b in zip(parts, parts[1:] + [n])]
    squares = []
    for part in parts:
        steps = [(b - a) ** 2 / 2 for a, b in zip(part, part[1:])]
        squares += steps + [steps[0] / 2, steps[-1] / 2]
    variance = sum(v * v for v in y) / (n - 1)
    rest = sum(squares) / n / variance
    influences = []
    for part in parts:
        for i, v in enumerate(part):
            near = part[max(i - 2, 0):i] + part[i + 1:i + 3]
            influences.append((rest * v * v - (v - sum(near) / len(near)) ** 2) / variance)
    mean = sum(influences) / n
    error = mpmath.sqrt(sum((i - mean) ** 2 for i in influences) / (n * (n - 6)))
    half = student_quantile(0.5 + 0.5 * float(confidence), n - 6) * error / rest
    bins = min(max(math.isqrt(n) // 2, 4), 64)
    edges = {b * n // bins for b in range(bins + 1)}
    for a, b in runs:
        if b - a >= n // bins:
            edges = {at for at in edges if at <= a or at >= b} | {a, b}
    edges = sorted(edges)
    test = scipy.stats.kruskal(*[ranked[a:b] for a, b in zip(edges, edges[1:])])
    return (1 - rest, error, 1 - rest * mpmath.exp(half), 1 - rest * mpmath.exp(-half),
            test.pvalue)


def rank_test(a, b):
    difference = columns[b] - columns[a]
    kept = difference[difference != 0]
    is_exact = len(kept) <= 50 and len(set(abs(kept))) == len(kept)
    return [scipy.stats.wilcoxon(kept, mode="exact" if is_exact else "approx",
                                 correction=False).pvalue]


def compare_unpaired(a, b, confidence):
    first, second = columns[a], columns[b]
    p_value = max(scipy.stats.ttest_ind(second, first, equal_var=equal).pvalue
                  for equal in (False, True))
    m, s = zip(*[exact_moments(c)[:2] for c in (first, second)])
    e = [float(deviation) ** 2 / len(c) for deviation, c in zip(s, (first, second))]
    degrees = sum(e) ** 2 / (e[0] ** 2 / (len(first) - 1) + e[1] ** 2 / (len(second) - 1))
    rest = len(first) + len(second) - 2
    variance = sum(float(deviation) ** 2 * (len(c) - 1)
                   for deviation, c in zip(s, (first, second))) / rest
    pooled = variance * (1 / len(first) + 1 / len(second))
    level = 0.5 + 0.5 * float(confidence)
    half = max(student_quantile(level, degrees) * math.sqrt(sum(e)),
               student_quantile(level, rest) * math.sqrt(pooled))
    law = scipy.stats.ks_2samp(first, second, mode="exact")
    difference = m[1] - m[0]
    return (difference, difference - half, difference + half, p_value, law.statistic,
            law.pvalue)


def compare_errors(a, b):
    first, second = columns[a], columns[b]
    limit = 2 * math.sqrt(np.mean(np.concatenate([first, second]) ** 2))
    # Of a location the larger p-value of both tests, of a scatter that of one variance for both.
    location = max((scipy.stats.ttest_ind(second, first, equal_var=equal) for equal in (False, True)),
                   key=lambda test: test.pvalue)
    # The mean of |x - m| scatters as that of |x - m| - s (x - m), s being the mean sign of x - m.
    deviations = [side - float(exact_moments(side)[0]) for side in (first, second)]
    scatters = [abs(d) - np.mean(np.sign(d)) * d for d in deviations]
    scale = scipy.stats.ttest_ind_from_stats(
        *(figure for d, s in zip(deviations, scatters)
          for figure in (float(exact_moments(abs(d))[0]), float(np.std(s, ddof=1)), len(d))),
        equal_var=True)
    beyond = [int((abs(side) > limit).sum()) for side in (first, second)]
    within = [len(first) - beyond[0], len(second) - beyond[1]]
    return limit, location.pvalue, scale.pvalue, scipy.stats.fisher_exact([beyond, within])[1]


def holm_adjusted(name):
    p = columns[name]
    return [max(min(1.0, (len(p) - i) * q) for i, q in enumerate(sorted(p)) if q <= value)
            for value in p]


# ---- laws -----------------------------------------------------------------------------------------


def beta_law(a, b, x):
    """Both tails by integrating the density, exact logarithms of Γ."""
    if min(a, b) < 1:
        lower = mpmath.betainc(a, b, 0, x, regularized=True) if max(a, b) < 1e5 else None
        return None if lower is None else (lower, 1 - lower)
    scale = mpmath.loggamma(a + b) - mpmath.loggamma(a) - mpmath.loggamma(b)

    def log_density(t):
        return scale + (a - 1) * mpmath.log(t) + (b - 1) * mpmath.log1p(-t)

    unit = log_density(x)  # Integrals are accurate relative to 1, tails must be to themselves.

    def density(t):
        return mpmath.exp(log_density(t) - unit)

    mean = a / (a + b)
    deviation = mpmath.sqrt(mean * (1 - mean) / (a + b + 1))
    points = [mean + k * deviation for k in range(-40, 41, 2)]
    points = [mpmath.mpf(0)] + [p for p in points if 0 < p < 1] + [mpmath.mpf(1)]
    lower = mpmath.quad(density, [p for p in points if p < x] + [x])
    upper = mpmath.quad(density, [x] + [p for p in points if p > x])
    return lower * mpmath.exp(unit), upper * mpmath.exp(unit)


def beta_tails(a, b, x):
    return beta_law(mpmath.mpf(a), mpmath.mpf(b), mpmath.mpf(float.fromhex(x)))


def gamma_tails(a, x):
    a, x = mpmath.mpf(a), mpmath.mpf(float.fromhex(x))
    if a > 1e5:
        return None
    return (mpmath.gammainc(a, 0, x, regularized=True),
            mpmath.gammainc(a, x, mpmath.inf, regularized=True))


def wilks_upper(name, coverage, confidence):
    values = columns[name]
    n = len(values)
    orders = [k + 1 for k in range(n)
              if scipy.stats.binom.cdf(k, n, 1 - float(coverage)) <= 1 - float(confidence)]
    value = np.sort(values)[n - max(orders)]
    return value, max(orders)


def binomial(k, n, p):
    law = scipy.stats.binom(int(n), float(p))
    return law.cdf(float(k)), law.sf(float(k) - 1)


def exact_quantile(hits, runs, start, tail):
    """The p at which at most so many hits have this probability: a step of Newton's method by exact
    sums, as scipy's quantiles are off by up to 2e-8 for few hits in 1e9 runs."""
    p, n = mpmath.mpf(float(start)), int(runs)
    term = (1 - p) ** n
    total = term
    for k in range(int(hits)):
        term *= (n - k) * p / ((k + 1) * (1 - p))
        total += term
    return p + (total - tail) * (1 - p) / ((n - int(hits)) * term)


def clopper_pearson(hits, runs, tail):
    """Bounds that each err with probability `tail`."""
    hits, runs = float(hits), float(runs)
    lower = scipy.stats.beta.ppf(tail, hits, runs - hits + 1) if hits > 0 else 0.0
    upper = scipy.stats.beta.isf(tail, hits + 1, runs - hits) if hits < runs else 1.0
    if hits <= 100 < runs:
        upper = exact_quantile(hits, runs, upper, tail)
        lower = exact_quantile(hits - 1, runs, lower, 1 - mpmath.mpf(tail)) if hits > 0 else 0.0
    return lower, upper


def probability_interval(hits, runs, confidence):
    return clopper_pearson(hits, runs, 0.5 - 0.5 * float(confidence))


def probability_bounds(hits, runs, confidence):
    return clopper_pearson(hits, runs, 1 - float(confidence))


def of_numbers(function):
    return lambda *arguments: [function(*(float(a) for a in arguments))]


# ---- comparison -----------------------------------------------------------------------------------

def tolerance_of_tails(arguments):
    largest = max(float(a) for a in arguments[:-1])
    return 1e-13 if largest <= 1e4 else TOLERANCE_OF_A_BILLION


def tolerance_of_probability(arguments):
    return TOLERANCE if float(arguments[1]) <= 1e6 else TOLERANCE_OF_A_BILLION


CHECKS = {  # function: (values, relative tolerance)
    "moments": (moments, TOLERANCE),
    "ranks": (ranks, 0.0),
    "percentile": (percentile, TOLERANCE),
    "mean_interval": (mean_interval, TOLERANCE),
    "deviation_interval": (deviation_interval, TOLERANCE),
    "percentile_interval": (percentile_interval, TOLERANCE),
    "bootstrap_deviation_interval": (bootstrap_deviation_interval, TOLERANCE),
    "linear_correlation": (linear_correlation, TOLERANCE),
    "rank_correlation": (rank_correlation, TOLERANCE),
    "first_order_index": (first_order_index, TOLERANCE),
    "rank_test": (rank_test, TOLERANCE),
    "compare_unpaired": (compare_unpaired, TOLERANCE),
    "compare_errors": (compare_errors, TOLERANCE),
    "holm_adjusted": (holm_adjusted, TOLERANCE),
    "student_quantile": (of_numbers(student_quantile), TOLERANCE),
    "student_two_sided": (of_numbers(lambda t, n: 2 * scipy.stats.t.sf(abs(t), n)), TOLERANCE),
    "beta_quantile": (of_numbers(scipy.stats.beta.ppf), TOLERANCE),
    "normal_cumulative": (of_numbers(scipy.special.ndtr), TOLERANCE),
    "kolmogorov_upper": (of_numbers(scipy.special.kolmogorov), TOLERANCE),
    "binomial": (binomial, TOLERANCE),
    "regularised_beta": (beta_tails, tolerance_of_tails),
    "regularised_gamma": (gamma_tails, tolerance_of_tails),
    "probability_interval": (probability_interval, tolerance_of_probability),
    "probability_bounds": (probability_bounds, tolerance_of_probability),
    "wilks_upper": (wilks_upper, 0.0),
}


def difference(value, expected):
    """Relative to the expected value."""
    if value == expected or abs(expected) < 1e-300:
        return abs(value)  if value != expected else 0.0
    return float(abs((mpmath.mpf(value) - mpmath.mpf(expected)) / mpmath.mpf(expected)))


def confirm(line, worst):
    question, _, numbers = line.partition(" :")
    function, *arguments = question.split()
    values = [float.fromhex(number) for number in numbers.split()]
    compute, tolerance = CHECKS[function]
    expected = compute(*arguments)
    if expected is None:
        return
    if callable(tolerance):
        tolerance = tolerance(arguments)
    assert len(values) == len(expected), f"{question}: {len(values)} values, not {len(expected)}"
    for value, other in zip(values, expected):
        found = difference(value, float(other) if tolerance == 0.0 else other)
        worst[function] = max(worst.get(function, 0.0), found)
        assert found <= tolerance, f"{question}: {value!r}, not {other} ({found:.1e} relative)"


def main(path):
    worst = {}
    failures = []
    num_confirmed = 0
    with open(path, encoding="ascii") as lines:
        for line in lines:
            if line.startswith("column "):
                _, name, *numbers = line.split()
                columns[name] = np.array([float.fromhex(number) for number in numbers])
                continue
            try:
                confirm(line, worst)
                num_confirmed += 1
            except AssertionError as error:
                failures.append(str(error))
    missing = sorted(set(CHECKS) - set(worst))
    for function, found in sorted(worst.items()):
        print(f"{function}: {found:.1e}")
    if missing:
        failures.append(f"never asked: {', '.join(missing)}")
    if failures:
        sys.exit("\n".join(failures))
    print(f"{num_confirmed} lines, all confirmed")


main(sys.argv[1])
