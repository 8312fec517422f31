"""Signatures beside flights of aircraft that have the effect: what is measured is what is said."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from linear_flight import DT, LIBRARY, OWN, SLOPES, Linear, Truth, distorted, effect, fly
from msgspec.structs import replace as changed

from freqid.core.errors import ImpossibleSettings
from freqid.core.record import Channel, Maneuver
from freqid.gap.lines import lines_of
from freqid.gap.residual import residual
from freqid.gap.signature import made, signature, sources_of
from freqid.gap.testable import route_of
from freqid.gap.together import together
from freqid.gap.tolerance import stated as stated_sizes
from freqid.gap.tolerance import tolerances
from freqid.gap.trial import Trial
from freqid.simulate.effects import shipped
from freqid.simulate.effects.effect import Parameter


def stiffer(extra):
    slopes = SLOPES.copy()
    slopes[2, 2] *= 1 + extra
    return Truth(slopes=tuple(map(tuple, slopes.tolist())))


def with_gyro(scale):
    flown = fly()
    return Maneuver(distorted({"scale": scale}, flown.record), flown.vehicle)


CASES = {  # effect, its size, a flight that has it, and how exact a first-order statement of it is
    "worn": (LIBRARY["worn"], 0.07, lambda: fly(Truth(loss=0.07)), 1e-6),
    "late": (LIBRARY["late"], 0.005, lambda: fly(Truth(late=0.005)), 0.04),
    "heavy": (LIBRARY["heavy"], 0.03, lambda: fly(Truth(mass=10.3)), 1e-6),
    "gyro": (LIBRARY["gyro"], 0.03, lambda: with_gyro(0.03), 0.04),
    "drag": (LIBRARY["drag"], 0.4, lambda: fly(Truth(drag=0.4)), 1e-6),
    "damping": (OWN, 0.1, lambda: fly(stiffer(0.1)), 1e-6),
}
HAS_IT = Linear(effects={"damping": {"extra": 0.0}})


def on_lines(maneuver, histories):
    return lines_of(maneuver.record, (0.05, 2.0)).transform(histories)


@pytest.mark.parametrize("name", CASES)
def test_a_residual_is_size_times_signature(name):
    effect, size, flown, exact = CASES[name]
    maneuver = flown()
    trial = Trial.of(HAS_IT, maneuver)
    measured = on_lines(maneuver, residual(HAS_IT, maneuver))
    perfect = on_lines(fly(), residual(HAS_IT, fly()))
    ((parameter, column),) = signature(effect, trial).items()
    linear = size * on_lines(maneuver, column)
    full = on_lines(maneuver, made(effect, trial, {parameter: size}))
    for row, z in enumerate(measured):
        # what integration and interpolation leave of a perfect simulation's residual is no gap
        floor = 3 * np.linalg.norm(perfect[row])
        assert np.linalg.norm(z - linear[row]) <= exact * np.linalg.norm(z) + floor
        assert np.linalg.norm(z - full[row]) <= exact * np.linalg.norm(z) + floor
    strongest = np.argmax(np.linalg.norm(measured, axis=1) / (np.linalg.norm(perfect, axis=1) + 1e-9))
    assert np.linalg.norm(measured[strongest]) > 20 * np.linalg.norm(perfect[strongest])


@pytest.mark.parametrize(
    ("name", "route"),
    [
        ("worn", "feel"),
        ("late", "act"),
        ("heavy", "load"),
        ("gyro", "distort"),
        ("drag", "replay"),
        ("damping", "own"),
    ],
)
def test_each_takes_its_own_route(name, route):
    assert route_of(CASES[name][0], HAS_IT) == route


def test_each_shows_where_it_acts():
    maneuver = fly()
    trial = Trial.of(HAS_IT, maneuver)
    for name, rows in (
        ("worn", {"Z", "M"}),
        ("late", {"actuator/d1", "actuator/d2"}),
        ("heavy", {"X", "Z"}),
        ("gyro", {"Z", "M", "kinematic/u", "kinematic/w", "kinematic/theta"}),
        ("drag", {"X"}),
        ("damping", {"M"}),
    ):
        ((_, column),) = signature(CASES[name][0], trial).items()
        moved = [bool(d.any() or h.any()) for d, h in zip(column.direct, column.momentum, strict=True)]
        assert {r.name for r, m in zip(column.rows, moved, strict=True) if m} == rows, name


def test_signs_are_those_of_measured_less_simulated():
    record = fly().record
    trial = Trial.of(HAS_IT, fly())
    at = {row.name: i for i, row in enumerate(trial.measured.rows)}

    def column(name):
        ((_, found),) = signature(CASES[name][0], trial).items()
        return found

    assert column("worn").direct[at["M"]] == pytest.approx(40.0 * record["effector/d1"])
    assert column("heavy").direct[at["Z"]] == pytest.approx(-10.0 * record["state/az"])
    assert column("drag").direct[at["X"]] == pytest.approx(-(record["state/u"] - 20.0))
    assert column("gyro").momentum[at["M"]] == pytest.approx(2.0 * record["state/q"])
    assert column("gyro").direct[at["M"]] == pytest.approx(8.0 * record["state/q"])
    assert column("damping").direct[at["M"]] == pytest.approx(-8.0 * record["state/q"])
    rate = np.gradient(trial.positions["d1"], DT)
    late = column("late").direct[at["actuator/d1"]]
    assert np.corrcoef(late, -rate)[0, 1] > 0.999


def test_a_delay_moves_loads_where_the_simulation_has_no_actuators():
    simulation = Linear(actuators=False)
    trial = Trial.of(simulation, fly())
    ((_, column),) = signature(LIBRARY["late"], trial).items()
    record = trial.maneuver.record
    rate = np.gradient(record["effector/d1"], DT), np.gradient(record["effector/d2"], DT)
    expected = 40.0 * rate[0] + 8.0 * rate[1]
    assert column.direct[2][50:-50] == pytest.approx(expected[50:-50], abs=0.05 * np.abs(expected).max())
    assert sources_of(LIBRARY["late"], trial, "by") == trial.inputs


def test_effects_between_command_and_airframe_follow_one_another():
    trial = Trial.of(Linear(actuators=False), fly())
    worn, late = LIBRARY["worn"], LIBRARY["late"]
    both = together([late, worn], trial, {"late": {"by": 0.04}, "worn": {"share": 0.5}})
    record = trial.maneuver.record
    d1, d2 = (record[f"effector/{n}"] for n in ("d1", "d2"))
    change = -40.0 * (0.5 * d1[:-2] - d1[2:]) - 8.0 * (d2[:-2] - d2[2:])  # 0.04 s are two samples
    assert both.direct[2, 2:] == pytest.approx(change, abs=1e-9)


def test_a_parameter_that_may_not_be_negative_is_stepped_to_one_side():
    seen = []

    def replayed(settings, replay):
        seen.append(settings["size"])
        return settings["size"] * np.ones((6, replay.record.time.size))

    one = effect("one", "size", 0.2, replay=replayed)
    one = replace(one, parameters={"size": replace(one.parameters["size"], low=0.0)})
    ((_, column),) = signature(one, Trial.of(HAS_IT, fly())).items()
    assert min(seen) >= 0
    assert column.direct[:3] == pytest.approx(1.0)


def test_a_size_is_told_at_two_places_where_its_place_says_nothing_while_it_is_zero():
    def replayed(settings, replay):
        found = np.zeros((6, replay.record.time.size))
        found[2] = settings["size"] * np.maximum(replay.record["state/w"] - settings["onset"], 0.0)
        return found

    stall = replace(
        effect("stall", "size", 1.0, replay=replayed),
        parameters={"size": Parameter(0.0, "1", "", 1.0), "onset": Parameter(1.0, "m/s", "", 0.1, 0.0)},
    )
    trial = Trial.of(HAS_IT, fly())
    found = signature(stall, trial)
    assert set(found) == {"size", "size|onset=0.8", "size|onset=1.2"}
    for name, onset in (("size", 1.0), ("size|onset=0.8", 0.8), ("size|onset=1.2", 1.2)):
        expected = np.maximum(trial.maneuver.record["state/w"] - onset, 0.0)
        assert found[name].direct[1] == pytest.approx(expected)
    named = replace(stall.parameters["onset"], looked_at=(0.5, 0.7, 1.5))
    stall = replace(stall, parameters={**stall.parameters, "onset": named})
    assert set(signature(stall, trial)) == {"size", *(f"size|onset={x}" for x in named.looked_at)}


def test_a_stall_that_begins_early_shows_in_a_light_aircraft_flown_slowly():
    flight = fly(add={"state/w": np.full(fly().record.time.size, 20 * np.tan(0.17))})
    air = Channel("air/rho", "kg/m3", np.full(flight.record.time.size, 1.1), 1 / DT, "made here")
    described = changed(flight.vehicle, area_m2=16.0)
    trial = Trial.of(Linear(), Maneuver(flight.record.with_channels(air), described))
    found = signature(shipped()["stall"], trial)
    shown = {name for name, change in found.items() if change.direct.any()}
    assert "strength|onset=0.15" in shown
    assert "strength" not in shown  # its onset is a sine of 0.3


def test_sources_are_the_channels_that_a_signature_is_computed_from():
    trial = Trial.of(HAS_IT, fly())
    assert sources_of(LIBRARY["late"], trial, "by") == ()
    assert {"state/ax", "state/az"} <= set(sources_of(LIBRARY["heavy"], trial, "fraction"))
    assert set(sources_of(LIBRARY["gyro"], trial, "scale")) == {"state/q", "d/dt state/q"}
    assert sources_of(LIBRARY["drag"], trial, "factor") == trial.inputs


def test_the_inertia_of_a_flat_body_is_stepped_to_the_side_that_it_can_have():
    """As of a multicopter: Izz is all but the sum of the others, and no body's is more."""
    flight = fly(Truth(), noise=0.0)
    stated = flight.vehicle.mass_properties
    whole = stated.inertia.xx + stated.inertia.yy
    flat = changed(stated.inertia, zz=0.9999 * whole)
    body = changed(flight.vehicle, mass_properties=changed(stated, inertia=flat))
    inertia = shipped()["inertia"]
    trial = Trial.of(Linear(), replace(flight, vehicle=body))
    with pytest.raises(ImpossibleSettings, match="expected positive ones"):
        made(inertia, trial, {"zz": 0.025})
    found = signature(inertia, trial)
    expected = made(inertia, trial, {"yy": 0.025}) * (1 / 0.025)
    assert expected.momentum.any()
    np.testing.assert_allclose(found["yy"].momentum, expected.momentum, rtol=1e-9, atol=1e-12)
    assert {"tolerance:inertia:xx", "tolerance:inertia:zz"} <= set(
        tolerances(trial, {"inertia": inertia}, stated_sizes({}, {"inertia": inertia})).common
    )
