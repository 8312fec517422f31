"""Derivatives about an instant of a flight: the scenario's own, turned into the axes that are asked for."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from freqid.core.record import Channel, FlightRecord
from freqid.core.scenario import read_scenario
from freqid.simulate.local_coefficients import local_coefficients

DEP6 = read_scenario(Path(__file__).resolve().parents[3] / "scenarios" / "dep6.toml")[0]


def steady(alpha, **effectors):
    time = np.arange(3) * 0.1
    values = {"air/V": 18.0, "air/alpha": alpha, "air/beta": 0.0, "air/rho": 1.2}
    values |= {f"state/{n}": 0.0 for n in "pqr"}
    values |= {f"effector/{e.name}": effectors.get(e.name[0], 0.0) for e in DEP6.effector}
    channels = {n: Channel(n, "1", np.full(3, x), 10.0, "test") for n, x in values.items()}
    return FlightRecord(time=time, channels=channels, vehicle=DEP6.aircraft())


@pytest.fixture(scope="module")
def theory(script):
    return script("benchmarks/dep6_aircraft.py")


def test_with_stopped_propellers_they_are_those_of_the_free_stream(theory):
    """At J = 1000, the last point of the tables, where there is no interpolation."""
    alpha = 0.1
    found = local_coefficients(DEP6, steady(alpha), axes="stability")
    lift, _, moment = (theory.statics(alpha, 1000.0)[i] for i in range(3))
    step = 1e-4
    slope = [(theory.statics(alpha + step, 1000.0)[i] - theory.statics(alpha - step, 1000.0)[i]) / (2 * step)
             for i in range(3)]  # fmt: skip
    drag = theory.statics(alpha, 1000.0)[1]
    still = theory.THRUST[3] * 6 * 2 * 0.23**2 / 0.5  # drag of the stopped propellers along x, over q S
    along, across = np.cos(alpha), np.sin(alpha)
    assert found["Z"]["de"] == pytest.approx(-theory.derivatives(1000.0)["CL"]["de"], rel=5e-5)
    assert found["M"]["de"] == pytest.approx(theory.derivatives(1000.0)["Cm"]["de"], rel=5e-5)
    assert found["M"]["qhat"] == pytest.approx(theory.derivatives(1000.0)["Cm"]["qhat"], rel=5e-5)
    assert found["M"]["alpha"] == pytest.approx(slope[2], rel=2e-3)
    # stability axes stand still while the angle of attack changes: drag and lift turn in them
    assert found["Z"]["alpha"] == pytest.approx(-slope[0] - drag, rel=5e-3)
    assert found["Z"]["bias"] + found["Z"]["alpha"] * alpha == pytest.approx(-lift - still * across, rel=2e-3)
    assert found["X"]["bias"] + found["X"]["alpha"] * alpha == pytest.approx(-drag + still * along, rel=5e-3)
    assert found["M"]["bias"] + found["M"]["alpha"] * alpha == pytest.approx(moment, abs=2e-4)


def test_lateral_derivatives_turn_with_the_axes(theory):
    alpha, speed = 0.15, 700.0
    ratio = 18.0 / (speed / (2 * np.pi) * 0.23)
    body = local_coefficients(DEP6, steady(alpha, n=speed), axes="body")
    turned = local_coefficients(DEP6, steady(alpha, n=speed), axes="stability")
    plain = theory.derivatives(ratio)
    for response, name in (("Y", "CY"), ("L", "Cl"), ("N", "Cn")):
        for variable in ("beta", "dr"):
            assert body[response][variable] == pytest.approx(plain[name][variable], rel=0.01, abs=2e-3)
    c, s = np.cos(alpha), np.sin(alpha)
    for variable in ("beta", "da", "dr", "phat", "rhat"):
        roll, yaw = body["L"][variable], body["N"][variable]
        assert turned["L"][variable] == pytest.approx(c * roll + s * yaw, abs=1e-9)
        assert turned["N"][variable] == pytest.approx(c * yaw - s * roll, abs=1e-9)


def test_derivatives_by_airspeed_are_at_held_rotor_speed():
    """Against central differences of the whole coefficient."""
    alpha, step = 0.08, 0.05

    def level(speed):
        record = steady(alpha, n=650.0)
        faster = record.with_channels(replace(record.channel("air/V"), values=np.full(3, speed)))
        found = local_coefficients(DEP6, faster)
        return {r: row["bias"] + row["alpha"] * alpha for r, row in found.items()}, found

    (low, _), (high, _), (_, found) = level(18.0 - step), level(18.0 + step), level(18.0)
    for response in ("X", "Z", "M"):
        slope = (high[response] - low[response]) / (2 * step)
        assert found[response]["V"] == pytest.approx(slope, rel=0.02)
