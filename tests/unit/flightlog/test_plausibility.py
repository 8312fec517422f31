"""Plausibility: kinematics in closed form, so that what sensors should show needs no integration."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from freqid.core.errors import DataError
from freqid.core.record import Channel, FlightRecord
from freqid.core.scenario import Reference
from freqid.core.vehicle import Effector, Inertia, MassProperties, Vehicle
from freqid.flightlog.plausibility.check import check_plausibility

G, DT = 9.80665, 0.02
TONES = np.array([0.11, 0.23, 0.37, 0.61])
UNITS = {
    **dict.fromkeys(("u", "v", "w"), "m/s"),
    **dict.fromkeys(("p", "q", "r"), "rad/s"),
    **dict.fromkeys(("phi", "theta", "psi"), "rad"),
    **dict.fromkeys(("ax", "ay", "az"), "m/s2"),
}
NOISE = {"m/s": 0.1, "rad/s": 0.002, "rad": 0.002, "m/s2": 0.05}
VEHICLE = Vehicle(
    name="test",
    mass_properties=MassProperties(mass_kg=10.0, inertia=Inertia(xx=1.0, yy=1.0, zz=1.5)),
    effectors=(
        Effector(name="da", kind="surface", limits=(-0.4, 0.4), rate_limit=4.0),
        Effector(name="db", kind="surface", limits=(-0.4, 0.4)),
    ),
)


def flight(seed=0, seconds=60.0):
    """Return a record of a motion made of sines: rates and specific forces follow by differentiation."""
    rng = np.random.default_rng(seed)
    t = np.arange(0, seconds, DT)
    omega = 2 * np.pi * TONES[:, None]
    sizes = np.array([0.25, 0.12, 0.2, 2.0, 2.0, 2.0]) / 2
    means = np.array([0.0, 0.06, 0.4, 25.0, 0.0, 1.5])
    phases = rng.uniform(0, 2 * np.pi, (6, TONES.size, 1))
    x = means[:, None] + np.array(
        [s * np.sin(omega * t + a).sum(axis=0) for s, a in zip(sizes, phases, strict=True)]
    )
    d = np.array(
        [s * (omega * np.cos(omega * t + a)).sum(axis=0) for s, a in zip(sizes, phases, strict=True)]
    )
    (phi, theta, psi, u, v, w), (dphi, dtheta, dpsi, du, dv, dw) = x, d
    p = dphi - dpsi * np.sin(theta)
    q = dtheta * np.cos(phi) + dpsi * np.cos(theta) * np.sin(phi)
    r = -dtheta * np.sin(phi) + dpsi * np.cos(theta) * np.cos(phi)
    ideal = {"u": u, "v": v, "w": w, "p": p, "q": q, "r": r, "phi": phi, "theta": theta, "psi": psi}
    ideal["ax"] = du + q * w - r * v + G * np.sin(theta)
    ideal["ay"] = dv + r * u - p * w - G * np.sin(phi) * np.cos(theta)
    ideal["az"] = dw + p * v - q * u - G * np.cos(phi) * np.cos(theta)
    channels = {
        f"state/{n}": value + NOISE[UNITS[n]] * rng.standard_normal(t.size) for n, value in ideal.items()
    }
    for k, name in enumerate(("da", "db")):
        tones = 0.2 + 0.2 * np.arange(8) + 0.1 * k
        command = 0.03 * np.sin(2 * np.pi * tones[:, None] * t + rng.uniform(0, 6, (8, 1))).sum(axis=0)
        channels[f"excitation/{name}"] = channels[f"command/{name}"] = command
        channels[f"effector/{name}"] = np.interp(t - 0.05, t, command) + 0.001 * rng.standard_normal(t.size)
    channels["air/rho"] = np.full(t.size, 1.2)
    units = {"air/rho": "kg/m3"} | {f"state/{n}": unit for n, unit in UNITS.items()}
    return FlightRecord(
        t, {n: Channel(n, units.get(n, "rad"), x, 1 / DT, "log.csv") for n, x in channels.items()}, VEHICLE
    )


def test_a_position_of_no_effector_of_the_scenario_is_named():
    record = flight()
    stranger = replace(record.channel("effector/da"), name="effector/dA", source="log.csv")
    (found,) = check_plausibility(record.with_channels(stranger)).findings
    assert (found.severity, found.check, found.channels) == ("warning", "effector", ("effector/dA",))
    assert "did you mean 'da'?" in str(found)


def changed(record, **values):
    by_name = {n.replace("__", "/"): x for n, x in values.items()}
    return record.with_channels(*(replace(record.channel(n), values=x) for n, x in by_name.items()))


@pytest.mark.parametrize("seed", range(5))
def test_a_good_log_has_no_finding(seed):
    report = check_plausibility(flight(seed))
    assert report.findings == ()
    assert min(report.agreement.values()) > 0.9


@pytest.mark.parametrize(
    ("check", "channels", "factor", "setting"),
    [
        ("sign", ("state/q",), -1.0, "sign"),
        ("sign", ("state/phi",), -1.0, "sign"),
        ("sign", ("state/ax", "state/ay", "state/az"), -1.0, "sign"),
        ("unit", ("state/p", "state/q", "state/r"), np.degrees(1.0), 'unit = "deg/s"'),
        ("unit", ("state/theta",), np.degrees(1.0), 'unit = "deg"'),
        ("unit", ("state/r",), np.radians(1.0), 'unit = "rad/s"'),
        ("unit", ("state/ax", "state/ay", "state/az"), 1 / G, 'unit = "g"'),
        ("unit", ("state/u", "state/v", "state/w"), 1 / 0.3048, 'unit = "ft/s"'),
        ("axes", ("state/q", "state/r", "state/ay", "state/az"), -1.0, "sign"),
        ("sign", ("effector/da",), -1.0, "sign"),
        ("unit", ("effector/db",), np.degrees(1.0), 'unit = "deg"'),
    ],
)
def test_a_wrong_factor_is_traced_to_its_channels(check, channels, factor, setting):
    good = flight(3)
    report = check_plausibility(changed(good, **{n.replace("/", "__"): factor * good[n] for n in channels}))
    (found,) = report.errors
    assert (found.check, set(found.channels)) == (check, set(channels))
    assert setting in found.setting
    assert found.channels[0] in found.setting
    with pytest.raises(DataError, match=r"log\.csv"):
        report.refuse("log.csv")


@pytest.mark.parametrize("pair", [("state/p", "state/r"), ("effector/da", "effector/db")])
def test_interchanged_columns(pair):
    good, (a, b) = flight(4), pair
    report = check_plausibility(
        changed(good, **{a.replace("/", "__"): good[b], b.replace("/", "__"): good[a]})
    )
    assert [(f.check, set(f.channels)) for f in report.errors] == [("swap", set(pair))]


def test_two_mistakes_are_both_found():
    good = flight(5)
    report = check_plausibility(
        changed(good, state__q=-good["state/q"], effector__da=57.3 * good["effector/da"])
    )
    assert {(f.check, f.channels) for f in report.errors} == {
        ("sign", ("state/q",)),
        ("unit", ("effector/da",)),
    }


def test_a_frozen_sensor_is_named_with_its_span():
    good = flight(6)
    x = good["state/p"].copy()
    x[1000:1100] = x[1000]
    (found,) = check_plausibility(changed(good, state__p=x)).findings
    assert (found.severity, found.check, found.channels) == ("error", "stuck", ("state/p",))
    assert found.span_s == (20.0, pytest.approx(21.98))


def test_a_short_freeze_costs_its_span_and_not_the_flight():
    good = flight(6)
    x = good["state/p"].copy()
    x[1000:1020] = x[1000]
    (found,) = check_plausibility(changed(good, state__p=x)).findings
    assert (found.severity, found.check) == ("warning", "stuck")


def test_coarse_resolution_is_neither_frozen_nor_latched():
    good = flight(7)
    calm = 25 + 0.3 * np.round(0.25 * np.sin(2 * np.pi * 0.05 * good.time) / 0.3, 0)
    report = check_plausibility(changed(good, state__psi=np.round(good["state/psi"], 2)))
    assert report.findings == ()
    assert np.unique(calm).size == 3
    assert not [f for f in check_plausibility(changed(good, state__u=calm)).findings if f.check == "latched"]


def test_a_latched_channel_is_told_its_rate():
    good = flight(8)
    x = np.repeat(good["state/q"][::5], 5)[: good.time.size]
    (found,) = check_plausibility(changed(good, state__q=x)).warnings
    assert (found.check, found.channels) == ("latched", ("state/q",))
    assert found.evidence["rate_hz"] == pytest.approx(10.0, rel=0.01)
    assert "rate_hz = 10" in found.setting


def test_one_impossible_sample_is_no_mistake_of_the_unit():
    good = flight(9)
    x = good["state/p"].copy()
    x[777] = 65535.0
    report = check_plausibility(changed(good, state__p=x))
    assert [f.check for f in report.errors] == ["range"]
    assert report.errors[0].evidence["samples"] == 1


def test_limits_of_the_scenario():
    good = flight(10)
    over = check_plausibility(
        changed(
            good,
            effector__da=4.0 * good["effector/da"],
            command__da=4.0 * good["command/da"],
            excitation__da=4.0 * good["command/da"],
        )
    )
    assert [(f.severity, f.check, f.channels) for f in over.findings] == [
        ("warning", "limit", ("effector/da",))
    ]
    step = good["effector/da"] + 0.2 * (good.time > 30)
    fast = check_plausibility(changed(good, effector__da=step)).warnings
    assert [(f.check, f.channels) for f in fast] == [("rate limit", ("effector/da",))]


def test_the_speed_of_another_unit_than_the_reference_states():
    good = flight(11)
    alone = replace(good, channels={n: good.channel(n) for n in ("state/u", "state/q")})
    (found,) = check_plausibility(alone, Reference(id="u13", u=25 * 0.514444, rho=1.2)).errors
    assert 'unit = "kt"' in found.setting
    assert not check_plausibility(alone, Reference(id="u25", u=25.0, rho=1.2)).findings


def test_a_column_that_nobody_filled_contradicts_what_moves():
    good = flight(12)
    report = check_plausibility(changed(good, state__phi=np.zeros(good.time.size)))
    assert ("error", "stuck", ("state/phi",)) in [(f.severity, f.check, f.channels) for f in report.findings]
