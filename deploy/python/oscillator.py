#!/usr/bin/env python3
"""A driven, damped oscillator, read by a noisy accelerometer: a model of proofmass in Python.

    x'' + 2 ζ ω₀ x' + ω₀² x = F cos ωt,    y = S x'' + noise

In the steady state S x'' = P cos ωt + Q sin ωt. A run estimates P, Q and the scale factor S, the
last one from a calibration signal of known size. The model deploy/model has the same in C++.

    proofmass init --model-program ./oscillator.py
    proofmass run oscillator.toml --model-program ./oscillator.py --runs 1000
    proofmass report oscillator.db
"""

import math

import proofmass_model as pm

# ω₀² − ω² over ω², and 2 ζ ω₀/ω; x = a cos ωt + b sin ωt, both over F/ω².
STIFF = "(pow(natural_hz / drive_hz, 2) - 1)"
LOSS = "(2 * damping_ratio * natural_hz / drive_hz)"
AMPLITUDE = f"(-scale_factor * drive_m_s2 / (pow({STIFF}, 2) + pow({LOSS}, 2)))"


class Oscillator(pm.Model):
    name, version = "oscillator", "1"
    purpose = "Measures how well a driven oscillator is known from a noisy reading."
    parameters = {
        "damping_ratio": 0.05,
        "drive_m_s2": 1e-6,
        "drive_hz": 0.01,
        "calibration_m_s2": 1e-7,
        "noise_m_s2": 1e-9,
        "samples": 512,
    }
    drawn = {
        "natural_hz": pm.uniform(0.019, 0.021, "Hz"),
        "scale_factor": pm.uniform(0.99, 1.01),
    }
    quantities = {
        "in_phase": pm.quantity(f"{AMPLITUDE} * {STIFF}", "m/s²", objective=2e-10, symbol="P",
                                standard_error=True, display_unit="nm/s²", display_scale=1e-9),
        "quadrature": pm.quantity(f"{AMPLITUDE} * {LOSS}", "m/s²", symbol="Q",
                                  standard_error=True, display_unit="nm/s²", display_scale=1e-9),
        "scale_factor": pm.quantity("scale_factor", objective=2e-3, symbol="S",
                                    standard_error=True),
    }

    def check(self, parameters):
        if parameters["samples"] < 16 or parameters["samples"] % 16:
            raise pm.Refused("samples", "must be a multiple of 16")

    def run(self, parameters, drawn, random):
        count = int(parameters["samples"])
        noise = parameters["noise_m_s2"]
        r = drawn["natural_hz"] / parameters["drive_hz"]
        stiff, loss = r * r - 1.0, 2.0 * parameters["damping_ratio"] * r
        amplitude = -drawn["scale_factor"] * parameters["drive_m_s2"] / (stiff**2 + loss**2)
        deviates = random.stream("noise")
        in_phase = quadrature = scale = 0.0
        for k in range(count):
            c, s = math.cos(math.tau * k / 16), math.sin(math.tau * k / 16)
            # The calibration's signal is at twice the drive's frequency.
            known = parameters["calibration_m_s2"] * math.cos(math.tau * k / 8)
            reading = amplitude * (stiff * c + loss * s) + drawn["scale_factor"] * known
            reading += deviates.gauss(0.0, noise)
            in_phase += reading * c
            quadrature += reading * s
            scale += reading * known
        estimate = {
            "in_phase": 2.0 / count * in_phase,
            "quadrature": 2.0 / count * quadrature,
            "scale_factor": 2.0 / count * scale / parameters["calibration_m_s2"] ** 2,
        }
        error = noise * math.sqrt(2.0 / count)
        errors = {"in_phase": error, "quadrature": error,
                  "scale_factor": error / parameters["calibration_m_s2"]}
        return estimate, errors


if __name__ == "__main__":
    Oscillator().serve()
