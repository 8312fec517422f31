"""Mistakes of bookkeeping that were made on purpose are named; effects of physics are not.

The aircraft and its simulation are written down here: a propeller aeroplane of known derivatives on a
prescribed motion, with the noise of good sensors. Forces are what its accelerometers say; moments, which no
prescribed motion follows, are recorded.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from types import SimpleNamespace

import numpy as np
import pytest

from freqid.core.errors import DataError
from freqid.core.record import Channel, FlightRecord
from freqid.core.vehicle import Effector, Inertia, MassProperties, Rotor, Vehicle
from freqid.dynamics.frames import level_from_body
from freqid.gap.bookkeeping.check import check
from freqid.gap.bookkeeping.correction import Correction

MASS, GRAVITY, INERTIA = 30.0, 9.80665, np.array([3.0, 6.0, 8.0])
AREA, SPAN, CHORD, SPIN = 1.2, 1.9, 0.35, 0.02
CENTRE = (0.12, 0.0, 0.0)
SURFACES = ("da", "de", "dr")
RATE, DURATION = 50.0, 30.0
TIME = np.arange(round(RATE * DURATION) + 1) / RATE
VEHICLE = Vehicle(
    name="made",
    mass_properties=MassProperties(
        mass_kg=MASS, inertia=Inertia(xx=INERTIA[0], yy=INERTIA[1], zz=INERTIA[2]), cg_m=CENTRE
    ),
    area_m2=AREA,
    span_m=SPAN,
    chord_m=CHORD,
    effectors=(
        *(Effector(name=n, kind="surface", limits=(-0.5, 0.5)) for n in SURFACES),
        Effector(name="n1", kind="rotor", limits=(0.0, 900.0)),
    ),
    rotors=(Rotor(name="n1", spin=1, inertia=SPIN),),
)


def multisine(rng, first, count=9, step=7):
    lines = (first + step * np.arange(count))[:, None]
    signal = np.sin(2 * np.pi * lines * TIME / DURATION + rng.uniform(0, 2 * np.pi, lines.shape)).sum(axis=0)
    return signal / np.sqrt(count / 2)


def aerodynamics(x):
    """Return X Y Z L M N of states, effectors and density by name, about the centre of gravity."""
    speed = np.sqrt(x["u"] ** 2 + x["v"] ** 2 + x["w"] ** 2)
    q, alpha, beta = 0.5 * x["rho"] * speed**2 * AREA, np.arctan2(x["w"], x["u"]), np.arcsin(x["v"] / speed)
    hat = {n: x[n] * length / (2 * speed) for n, length in (("p", SPAN), ("q", CHORD), ("r", SPAN))}
    thrust = x["rho"] * 1.2e-4 * x["n1"] ** 2
    lift = 0.35 + 4.8 * alpha + 0.5 * x["de"]
    return np.array(
        [
            thrust - q * (0.04 + 0.06 * lift**2) + q * lift * np.sin(alpha),
            q * (-0.7 * beta + 0.25 * x["dr"]),
            -q * lift * np.cos(alpha),
            q * SPAN * (-0.1 * beta - 0.45 * hat["p"] + 0.12 * hat["r"] + 0.14 * x["da"]),
            q * CHORD * (0.04 - 0.9 * alpha - 9.0 * hat["q"] - 1.1 * x["de"]),
            q * SPAN * (0.09 * beta - 0.03 * hat["p"] - 0.12 * hat["r"] - 0.09 * x["dr"]),
        ]
    )


def inputs(record):
    groups = {"state": "u v w p q r phi theta psi", "effector": "da de dr n1", "air": "rho"}
    return {n: record[f"{g}/{n}"] for g, names in groups.items() for n in names.split()}


def gyroscopic(x):
    """Return the moment that turns the rotor's momentum along with the body: w x H + dH/dt."""
    h = SPIN * x["n1"]
    return np.array([np.gradient(h, 1 / RATE), x["r"] * h, -x["q"] * h])


@pytest.fixture(scope="module")
def flight():
    """Return a record of an aircraft whose loads are a function of inputs."""

    def fly(loads=aerodynamics, rho=1.1, noise=1.0, seed=3):
        rng = np.random.default_rng(seed)
        base = {"u": 22.0, "w": 1.2, "rho": rho, "n1": 520.0, "theta": 0.05}
        size = {"u": 0.8, "v": 0.6, "w": 0.5, "p": 0.25, "q": 0.2, "r": 0.15, "phi": 0.1, "theta": 0.06}
        size |= {"psi": 0.1, "da": 0.06, "de": 0.05, "dr": 0.06, "n1": 25.0}
        names = (*size, "rho")
        x = {
            n: base.get(n, 0.0) + size.get(n, 0.0) * (multisine(rng, 2 + i % 7) if n in size else 1.0)
            for i, n in enumerate(names)
        }
        x["rho"] = np.full(TIME.size, rho)
        wrench = loads(x)
        values = {f"state/{n}": x[n] for n in ("u", "v", "w", "p", "q", "r", "phi", "theta", "psi")}
        values |= {f"state/a{n}": wrench[i] / MASS for i, n in enumerate("xyz")}
        values |= {f"effector/{n}": x[n] for n in (*SURFACES, "n1")} | {"air/rho": x["rho"]}
        values |= {f"response/{n}": wrench[3 + i] for i, n in enumerate("LMN")}
        sigma = (
            dict.fromkeys("uvw", 0.08) | dict.fromkeys("pqr", 0.002) | dict.fromkeys(("ax", "ay", "az"), 0.05)
        )
        sigma |= dict.fromkeys(SURFACES, 0.001) | {"n1": 0.5} | dict.fromkeys("LMN", 0.3)
        channels = {}
        for name, signal in values.items():
            draw = noise * sigma.get(name.partition("/")[2], 0.0) * rng.standard_normal(TIME.size)
            unit = {"air/rho": "kg/m3"}.get(name, "1")
            channels[name] = Channel(name, unit, signal + draw, RATE, "made")
        return FlightRecord(TIME, channels, VEHICLE)

    return fly


@dataclass(frozen=True)
class Made:
    """The aeroplane as somebody's simulation; `before` and `after` make its mistakes."""

    before: object = None
    after: object = None
    name: str = "made"
    kind: str = "callable"
    responses: tuple = ("X", "Y", "Z", "L", "M", "N")
    vehicle: Vehicle = VEHICLE
    effects: object = None
    parts: tuple = ()
    gyroscopic: object = True

    def predict(self, record, effects=None, departures=None):
        x = inputs(record)
        x = self.before(x) if self.before else x
        loads = aerodynamics(x)
        return self.after(loads, inputs(record)) if self.after else loads

    def gradient(self, record, names):
        columns = []
        for name in names:
            step = 1e-3 * max(1.0, np.abs(record[name]).max())
            above, below = (
                self.predict(record.with_channels(replace(record.channel(name), values=record[name] + s)))
                for s in (step, -step)
            )
            columns.append((above - below) / (2 * step))
        return np.stack(columns, axis=1)


def times(factor, *rows):
    def after(loads, x):
        loads = loads.copy()
        loads[list(rows)] *= factor
        return loads

    return after


def scaled(factor, *names):
    return lambda x: x | {n: factor * x[n] for n in names}


def about(point):
    arm = np.subtract(CENTRE, point)

    def after(loads, x):
        return np.concatenate([loads[:3], loads[3:] + np.cross(arm, loads[:3].T).T])

    return after


def weighed(loads, x):
    turn = level_from_body(np.array([x["phi"], x["theta"], x["psi"]]))
    return np.concatenate([loads[:3] + MASS * GRAVITY * turn[2], loads[3:]])


def late(seconds):
    def after(loads, x):
        return np.array([np.interp(TIME - seconds, TIME, row) for row in loads])

    return after


def pressure(x):
    return 0.5 * x["rho"] * (x["u"] ** 2 + x["v"] ** 2 + x["w"] ** 2) * AREA


LENGTHS = np.array([1, 1, 1, SPAN, CHORD, SPAN])[:, None]
MISTAKES = {
    "sign of Z": (Made(after=times(-1, 2)), "response_sign", "Z"),
    "sign of M": (Made(after=times(-1, 4)), "response_sign", "M"),
    "sign of the elevator": (Made(scaled(-1, "de")), "effector_sign", "de"),
    "aileron and rudder exchanged": (
        Made(lambda x: x | {"da": x["dr"], "dr": x["da"]}),
        "swapped_effectors",
        "da dr",
    ),
    "surfaces in degrees": (Made(scaled(np.pi / 180, *SURFACES)), "degrees", "da de dr"),
    "rates in degrees": (Made(scaled(np.pi / 180, "p", "q", "r")), "degrees", "p q r"),
    "pounds": (Made(after=times(1 / 4.4482216, 0, 1, 2)), "units", "X Y Z"),
    "pound-feet": (Made(after=times(1 / 1.3558179, 3, 4, 5)), "units", "L M N"),
    "accelerations": (Made(after=times(1 / MASS, 0, 1, 2)), "units", "X Y Z"),
    "coefficients": (Made(after=lambda y, x: y / pressure(x) / LENGTHS), "coefficient", "X Y Z L M N"),
    "moments about the origin": (Made(after=about((0, 0, 0))), "moment_reference", "L M N"),
    "weight in the forces": (Made(after=weighed), "gravity", "X Y Z"),
    "y left and z up": (Made(after=times(-1, 1, 2, 4, 5)), "axes", "Y Z M N"),
    "X and Y exchanged": (Made(after=lambda y, x: y[[1, 0, 2, 3, 4, 5]]), "swapped_responses", "X Y"),
    "0.2 s late": (Made(after=late(0.2)), "time_shift", "X Y Z L M N"),
    "trim missing": (Made(after=lambda y, x: y - y.mean(1, keepdims=True)), "trim_level", "Z"),
    "density of sea level": (Made(lambda x: x | {"rho": np.full(TIME.size, 1.225)}), "density", "rho"),
    "rotor counted twice": (
        Made(after=lambda y, x: np.concatenate([y[:3], y[3:] - gyroscopic(x)])),
        "gyroscopic",
        "L M N",
    ),
}


@pytest.mark.parametrize("mistake", MISTAKES)
def test_a_mistake_is_called_by_its_name(flight, mistake):
    simulation, fault, subject = MISTAKES[mistake]
    (found,) = check(simulation, [flight()])
    assert (found.fault, found.subject) == (fault, subject)
    assert found.explained > 0.85


def test_a_simulation_without_mistakes_has_none(flight):
    assert check(Made(), [flight(), flight(seed=4)]) == []
    assert check(Made(), [flight(noise=3.0)]) == []


def weaker(x):
    return aerodynamics(x | {"de": 0.85 * x["de"]})


def slower(x):
    moved = {n: np.interp(TIME - 0.06, TIME, x[n]) for n in SURFACES}
    return aerodynamics(x | moved)


def dragging(x):
    return aerodynamics(x) - np.outer([1, 0, 0, 0, 0, 0], 0.02 * pressure(x))


def shifted(x):
    loads = aerodynamics(x)
    return np.concatenate([loads[:3], loads[3:] + np.cross([0.02, 0, 0], loads[:3].T).T])


def lagging(x):
    loads, share = aerodynamics(x), np.exp(-1 / (RATE * 0.12))
    out = loads.copy()
    for k in range(1, TIME.size):
        out[2, k] = share * out[2, k - 1] + (1 - share) * loads[2, k]
    return out


def half_powered(x):
    return aerodynamics(x | {"n1": 0.9 * x["n1"]})


@pytest.mark.parametrize("physics", [weaker, slower, dragging, shifted, lagging, half_powered])
def test_physics_is_not_called_bookkeeping(flight, physics):
    assert check(Made(), [flight(physics)]) == []


def test_two_mistakes_are_both_found(flight):
    both = Made(scaled(-1, "dr"), times(1 / 4.4482216, 0, 1, 2))
    for flights in ([flight()], [flight(), flight(rho=0.9, seed=4), flight(seed=5)]):
        assert {f.fault for f in check(both, flights)} == {"effector_sign", "units"}


def test_a_mistake_that_is_in_one_record_of_two_is_none(flight):
    def reversed_rudder(x):
        return aerodynamics(x | {"dr": -x["dr"]})

    assert {f.fault for f in check(Made(), [flight(reversed_rudder)])} == {"effector_sign"}
    assert check(Made(), [flight(reversed_rudder), flight(seed=4)]) == []


def test_a_simulation_that_does_not_reproduce_its_own_flight_is_told(flight):
    (found,) = check(Made(), [flight(weaker, noise=0.0)], own=True)
    assert (found.fault, found.subject) == ("self_replay", "M")
    assert check(Made(), [flight(noise=0.0)], own=True) == []


def test_a_simulation_that_is_made_for_the_densities_flown_alone_is_checked(flight):
    """Whether it uses the density cannot be told; that is no reason to end the check."""

    def bounded(x):
        if x["rho"].max() > 1.15:
            raise DataError("the density is outside the table")
        return x

    assert check(Made(bounded), [flight()]) == []


def test_a_constant_where_the_records_move_is_refused(flight):
    with pytest.raises(DataError, match=r"returned the constant 0 as 'Y', which changes by .* \(rms\)"):
        check(Made(after=times(0.0, 1)), [flight()])


def test_one_number_is_no_evidence_of_a_mistake():
    """In hover a factor on the velocities changes hardly more than the level of one force."""
    quiet, rng = np.zeros((3, 40)), np.random.default_rng(0)

    def record(level, motion):
        now, there = (motion, np.array(level)), (quiet, np.zeros(3))
        return SimpleNamespace(predicted=now, degrees_of_freedom=20, residual=lambda p: p), there

    def correction(*records):
        comparisons, there = zip(*records, strict=True)
        return Correction.of(comparisons, there, ())

    assert not correction(record([0, 0, 0], quiet), record([1.5, 0.1, 0], quiet)).sharp
    assert correction(record([1.5, 0, 0], quiet), record([1.5, 0.1, 0], quiet)).sharp
    assert correction(record([1.5, 0, 0], rng.normal(0, 0.2, (3, 40)))).sharp
