#!/usr/bin/env python3
"""The centre-of-mass calibration of a satellite with one accelerometer: a model of proofmass in Python.

    y = S [(−V + Ω² + Ω̇) d + a_ng] + b + n

Torques about one axis at a time, periodic, reveal the offset d of the accelerometer from the centre
of mass. deploy/accelerometers has the same in C++, and says where its numbers are from.

    proofmass init --model-program ./centre_of_mass.py
    proofmass run grace-fo-com.toml --model-program ./centre_of_mass.py --runs 1000
"""

import math

import proofmass_model as pm

AXES = "xyz"
ORBIT_RATE = 1.11e-3  # rad/s, at 490 km.


class CentreOfMass(pm.Model):
    name, version = "grace-fo-com", "1"
    purpose = "Measures how well torques reveal the offset of an accelerometer."
    parameters = {
        "torque_rad_s2": 1e-5,
        "torque_period_s": 12.0,
        "torque_periods": 15,
        "sample_period_s": 0.1,
        "noise_m_s2_rthz": 1e-10,
        "scale_deviation": 0.01,  # What the standard errors take for that of the drawn scale.
    }
    drawn = {
        **{f"offset_{axis}_m": pm.normal(0.0, 50e-6, "m") for axis in AXES},
        **{f"scale_{axis}": pm.normal(1.0, 0.01) for axis in AXES},
        **{f"bias_{axis}_m_s2": pm.normal(0.0, 1e-6, "m/s²") for axis in AXES},
        **{f"drift_{axis}_m_s3": pm.normal(0.0, 1e-10, "m/s³") for axis in AXES},
    }
    quantities = {
        f"offset_{axis}": pm.quantity(f"offset_{axis}_m", "m", objective=10e-6, symbol=f"d_{axis}",
                                      standard_error=True, display_unit="µm", display_scale=1e-6)
        for axis in AXES
    }

    def check(self, parameters):
        if parameters["torque_periods"] < 1 or parameters["torque_periods"] % 1:
            raise pm.Refused("torque_periods", "must be a whole number, at least 1")
        if not 0 < 4 * parameters["sample_period_s"] <= parameters["torque_period_s"]:
            raise pm.Refused("sample_period_s", "must be at most a quarter of torque_period_s")

    def run(self, parameters, drawn, random):
        vector = lambda name, unit="": [drawn[f"{name}_{axis}{unit}"] for axis in AXES]
        offset, scale = vector("offset", "_m"), vector("scale")
        bias, drift = vector("bias", "_m_s2"), vector("drift", "_m_s3")
        period = parameters["sample_period_s"]
        duration = parameters["torque_period_s"] * parameters["torque_periods"]
        times = [period * k for k in range(round(duration / period))]
        sigma = parameters["noise_m_s2_rthz"] / math.sqrt(2 * period)
        deviates = random.stream("noise")
        normal = [[[0.0] * 3 for _ in AXES] for _ in AXES]  # Of each axis that reads.
        right = [0.0] * 3
        for session in range(3):
            gradients = [gradient(parameters, session, time) for time in times]
            for i in range(3):
                reading = [scale[i] * (dot(g[i], offset) + drift[i] * time) + bias[i]
                           + deviates.gauss(0.0, sigma) for g, time in zip(gradients, times)]
                # A constant and a drift of each session stand for b and a_ng.
                without_drift(reading)
                columns = [[g[i][l] for g in gradients] for l in range(3)]
                for column in columns:
                    without_drift(column)
                for l in range(3):
                    right[l] += dot(columns[l], reading)
                    for m in range(3):
                        normal[i][l][m] += dot(columns[l], columns[m])
        inverse = inverse_of([[sum(n[l][m] for n in normal) for m in range(3)] for l in range(3)])
        estimate = [dot(row, right) for row in inverse]
        # The fit takes S for 1: a deviation of S_i by 1 moves the estimate by N⁻¹ N_i d.
        moved = [[dot(row, [dot(r, estimate) for r in n]) for row in inverse] for n in normal]
        error = [math.sqrt(sigma**2 * inverse[l][l]
                           + parameters["scale_deviation"]**2 * sum(m[l]**2 for m in moved))
                 for l in range(3)]
        return dict(zip(self.quantities, estimate)), dict(zip(self.quantities, error))


def dot(a, b):
    return sum(map(lambda x, y: x * y, a, b))


def gradient(parameters, session, time):
    """−V + Ω² + Ω̇ with a torque about the axis of a session; V as if the attitude did not move."""
    omega = math.tau / parameters["torque_period_s"]
    w, a = [0.0, -ORBIT_RATE, 0.0], [0.0] * 3
    a[session] = parameters["torque_rad_s2"] * math.sin(omega * time)
    w[session] -= parameters["torque_rad_s2"] / omega * math.cos(omega * time)
    g = [[w[i] * w[j] - (dot(w, w) if i == j else 0.0) for j in range(3)] for i in range(3)]
    for i, factor in enumerate((1.0, 1.0, -2.0)):
        g[i][i] += factor * ORBIT_RATE**2
        g[i - 2][i - 1] -= a[i]
        g[i - 1][i - 2] += a[i]
    return g


def without_drift(signal):
    """Subtracts the constant and the slope that fit best; about the middle they are orthogonal."""
    middle, mean = (len(signal) - 1) / 2, sum(signal) / len(signal)
    slope = sum((k - middle) * value for k, value in enumerate(signal))
    slope *= 12 / (len(signal) * (len(signal)**2 - 1))
    signal[:] = [value - mean - slope * (k - middle) for k, value in enumerate(signal)]


def inverse_of(m):
    cofactors = [[m[i - 2][j - 2] * m[i - 1][j - 1] - m[i - 2][j - 1] * m[i - 1][j - 2]
                  for i in range(3)] for j in range(3)]
    return [[c / dot(m[0], [row[0] for row in cofactors]) for c in row] for row in cofactors]


if __name__ == "__main__":
    CentreOfMass().serve()
