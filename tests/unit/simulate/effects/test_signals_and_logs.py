"""What effects do to positions, logs and mass properties, against closed forms."""

from pathlib import Path

import numpy as np
import pytest

from freqid.core.errors import UsageError
from freqid.core.record import Channel, FlightRecord
from freqid.core.scenario import read_scenario
from freqid.core.units import parse_unit
from freqid.core.vehicle import Effector, Inertia, MassProperties, Vehicle
from freqid.simulate import effects
from freqid.simulate.effects import along
from freqid.simulate.effects.channel_groups import BIAS
from freqid.simulate.effects.needs import unmet
from freqid.simulate.effects.signals import delayed, logged_late

VEHICLE = read_scenario(Path(__file__).parents[4] / "scenarios" / "la8.toml")[0].aircraft()
KINDS = VEHICLE.effector_kinds
DT = 0.02
TIME = DT * np.arange(1500)
W = 2 * np.pi * 0.8
FILES = Path(effects.__file__).parent.glob("*.py")
IDS = [p.stem for p in FILES if "EFFECT = Effect(" in p.read_text(encoding="utf-8").splitlines()]


def usual(identifier, **changed):
    """Settings with the effect's size at zero where nothing else is said."""
    effect = effects.find(identifier).of(VEHICLE)
    return {n: p.default for n, p in effect.parameters.items()} | {effect.size: 0.0} | changed


def act(identifier, signals, **changed):
    effect = effects.find(identifier)
    return (effect.act or effect.feel)(usual(identifier, **changed), signals, DT, KINDS)


def log(**rows):
    units = {
        "a": "m/s2",
        "q": "rad/s",
        "p": "rad/s",
        "r": "rad/s",
        "phi": "rad",
        "theta": "rad",
        "psi": "rad",
    }
    channels = {}
    for name, values in rows.items():
        group, _, short = name.rpartition("__")
        unit = units.get(short) or units.get(short[0]) or "m/s"
        channel = f"{group or 'state'}/{short}"
        unit = "rad" if short in ("alpha", "beta", "de1") else unit
        channels[channel] = Channel(channel, unit, np.broadcast_to(values, TIME.shape) * 1.0, 50.0, "made")
    return FlightRecord(TIME, channels, VEHICLE)


def distort(identifier, record, **changed):
    return effects.find(identifier).distort(usual(identifier, **changed), record)


def test_the_library_is_complete_and_declares_units_scales_and_ranges():
    assert sorted(effects.shipped()) == sorted(IDS)
    for effect in effects.shipped().values():
        for name, parameter in effect.of(VEHICLE).parameters.items():
            assert parameter.unit == "1" or parse_unit(parameter.unit), (effect.id, name)
            assert parameter.scale >= 0
            assert parameter.low <= parameter.default <= parameter.high
            if parameter.scale and parameter.default == 0:
                assert parameter.low < parameter.scale <= parameter.high, (effect.id, name)
        assert effect.of(VEHICLE).parameters[effect.size].scale > 0
        assert any((effect.act, effect.feel, effect.distort, effect.load, effect.replay)) or (
            effect.id == "turbulence"
        )


@pytest.mark.parametrize("identifier", [i for i, e in effects.shipped().items() if e.act or e.feel])
def test_positions_are_untouched_at_zero_and_moved_at_one_scale(identifier):
    signals = {"de1": 0.3 * np.sin(2 * W * TIME), "n1": 500 + 20 * np.sin(W * TIME), "dw1": 0.1 * TIME}
    effect = effects.find(identifier)
    same = act(identifier, signals)
    assert all(np.array_equal(same[n], signals[n]) for n in signals)
    moved = act(identifier, signals, **{effect.size: effect.parameters[effect.size].scale})
    changed = {n for n in signals if np.abs(moved[n] - signals[n]).max() > 1e-3}
    expected = {
        "actuator_delay": {"de1", "n1", "dw1"},
        "actuator_lag": {"de1", "dw1"},
        "motor_lag": {"n1"},
        "battery_sag": {"n1"},
        "weak_rotor": {"n1"},
    }
    assert changed == expected.get(identifier, {"de1"})


def test_a_delay_shifts_a_sine_by_any_fraction_of_a_sample():
    for delay in (0.003, 0.02, 0.0537):
        moved = act("actuator_delay", {"de1": np.sin(W * TIME)}, extra=delay)["de1"]
        np.testing.assert_allclose(moved[10:], np.sin(W * (TIME[10:] - delay)), atol=1e-4)


def test_an_effector_that_is_called_like_its_kind_is_delayed_once():
    signals = {"rotor": np.sin(W * TIME), "n2": np.sin(W * TIME)}
    kinds = dict.fromkeys(signals, "rotor")
    moved = effects.find("actuator_delay").act({"extra": 0.0, "rotor": 0.05}, signals, DT, kinds)
    np.testing.assert_allclose(moved["rotor"][10:], np.sin(W * (TIME[10:] - 0.05)), atol=1e-4)
    np.testing.assert_array_equal(moved["n2"], signals["n2"])


@pytest.mark.parametrize(("identifier", "name"), [("actuator_lag", "de1"), ("motor_lag", "n1")])
def test_a_lag_turns_a_sine_by_its_closed_form(identifier, name):
    tau = 0.07
    moved = act(identifier, {name: np.sin(W * TIME)}, extra=tau)[name]
    expected = np.sin(W * TIME - np.arctan(W * tau)) / np.hypot(1, W * tau)
    np.testing.assert_allclose(moved[100:], expected[100:], atol=1e-3)
    assert moved[0] == 0.0
    # a signal that stays has always been there
    np.testing.assert_allclose(act(identifier, {name: np.full(50, 3.0)}, extra=tau)[name], 3.0)


def test_a_rate_limit_turns_a_fast_sine_into_a_triangle_of_its_rate():
    moved = act("rate_limit", {"de1": 0.5 * np.sin(2 * np.pi * TIME)}, slowness=1.0)["de1"]
    rates = np.diff(moved[200:]) / DT
    assert np.abs(rates).max() <= 1.0 + 1e-9
    assert np.mean(np.abs(np.abs(rates) - 1.0) < 1e-9) > 0.9
    assert np.ptp(moved[200:]) == pytest.approx(0.5, abs=0.03)  # rate times half a period


def test_backlash_takes_half_its_width_off_a_slow_sine_and_holds_at_its_turns():
    moved = act("backlash", {"de1": 0.1 * np.sin(W * TIME)}, width=0.04)["de1"]
    assert moved.max() == pytest.approx(0.08, abs=1e-4)
    assert moved.min() == pytest.approx(-0.08, abs=1e-4)
    still = np.mean(np.diff(moved[100:]) == 0)
    # it rests while the servo comes back by the width: arccos(1 - 0.04 / 0.1) of half a turn
    assert still == pytest.approx(np.arccos(0.6) / np.pi, abs=0.02)


def test_losses_are_at_one_place_or_at_all():
    signals = {
        "de1": np.full(3, 0.2),
        "de2": np.full(3, 0.2),
        "n3": np.full(3, 400.0),
        "n4": np.full(3, 400.0),
    }
    moved = act("surface_effectiveness", signals, loss=0.1, de2=0.3)
    assert [moved[n][0] for n in signals] == pytest.approx([0.18, 0.12, 400.0, 400.0])
    moved = act("weak_rotor", signals, n3=0.2)
    assert [moved[n][0] for n in signals] == pytest.approx([0.2, 0.2, 400.0 * np.sqrt(0.8), 400.0])
    moved = act("weak_rotor", signals, loss=1.0)  # no rotor at rest, whose advance ratio is infinite
    assert moved["n3"][0] == pytest.approx(200.0)


def test_rotors_droop_with_the_power_that_all_of_them_take():
    speed = 500 + 100 * np.sin(W * TIME)
    moved = act("battery_sag", {"n1": speed, "n2": speed}, strength=1.0)["n1"]
    np.testing.assert_allclose(1 - moved / speed, 0.03 * speed**3 / np.mean(speed**3))


def test_rotors_slow_down_as_a_battery_empties():
    speed = np.full(TIME.size, 500.0)
    moved = act("battery_sag", {"n1": speed}, strength=0.5, emptying=2e-4)["n1"]
    np.testing.assert_allclose(1 - moved / speed, 0.5 * (0.03 + 2e-4 * (TIME - TIME[0])))


def test_a_motor_that_is_slower_is_not_a_lag_before_it():
    """The answers of motors of 0.1 and of 0.15 s to a sine, in closed form."""
    described, slower = (
        500 + 50 * np.cos(turned) * np.sin(W * TIME - turned)
        for turned in np.arctan(W * np.array([0.1, 0.15]))
    )
    settled = TIME > 3
    moved = act("motor_lag", {"n1": described}, extra=0.05, time_constant=0.1)["n1"]
    np.testing.assert_allclose(moved[settled], slower[settled], atol=1e-3)
    before = act("motor_lag", {"n1": described}, extra=0.05)["n1"]
    assert np.abs(before - slower)[settled].max() > 0.1


@pytest.mark.parametrize("identifier", [i for i, e in effects.shipped().items() if e.distort])
def test_a_log_is_untouched_at_zero(identifier):
    record = log(
        u=20.0, v=np.sin(TIME), w=1.0, p=0.1, q=0.2, r=0.0, ax=0.1, ay=0.0, az=-9.0, phi=3.1, theta=0.1, psi=0
    )
    same = distort(identifier, record)
    assert all(np.allclose(same[n], record[n], rtol=0, atol=1e-12) for n in record.channels)


def test_bias_and_scale_reach_the_channels_of_their_names():
    record = log(q=np.sin(TIME), effector__de1=0.1, air__alpha=0.05)
    read = distort("sensor_bias", record, q=0.01, surface=0.02, alpha=0.03, az=9.0)
    for name, bias in (("state/q", 0.01), ("effector/de1", 0.02), ("air/alpha", 0.03)):
        np.testing.assert_allclose(read[name] - record[name], bias)
    np.testing.assert_allclose(distort("sensor_scale", record, q=0.1)["state/q"], 1.1 * np.sin(TIME))
    both = distort("sensor_scale", record, surface=0.1, de1=0.05)  # one after the other
    np.testing.assert_allclose(both["effector/de1"], 1.1 * 1.05 * 0.1)
    assert set(BIAS) == set(effects.find("sensor_bias").parameters)


def test_a_pitot_tube_scales_all_velocities_at_once_and_no_angle():
    record = log(u=20.0, v=np.sin(TIME), w=1.0, vn=19.0, air__V=20.1, air__alpha=0.05)
    found = distort("sensor_scale", record, airspeed=0.04)
    for name in record.channels:
        scale = 1.04 if name in ("state/u", "state/v", "state/w", "air/V") else 1.0
        np.testing.assert_allclose(found[name], scale * record[name], rtol=1e-12)
    alone = log(air__V=20.1, q=0.1)  # it is `V` there
    np.testing.assert_array_equal(distort("sensor_scale", alone, airspeed=0.04)["air/V"], alone["air/V"])


def test_an_effector_with_the_name_of_its_kind_stands_for_all_of_the_kind():
    pair = tuple(Effector(name=n, kind="tilt", limits=(0.0, 1.5)) for n in ("tilt", "aft"))
    body = MassProperties(mass_kg=1.0, inertia=Inertia(xx=1.0, yy=1.0, zz=1.0))
    scale = effects.find("sensor_scale").of(Vehicle(name="two tilts", mass_properties=body, effectors=pair))
    assert "aft" in scale.parameters
    assert scale.parameters["tilt"].sought


@pytest.mark.parametrize("age", [0.036, -0.036])
def test_a_late_log_goes_on_at_its_ends_as_the_flight_did(age):
    """A log is cut out of a flight: a rate that is held at its end is an impulse of moment there."""
    late = logged_late(np.sin(W * TIME), DT, age)
    np.testing.assert_allclose(late, np.sin(W * (TIME - age)), atol=0.02)
    held = delayed(np.sin(W * TIME), DT, age)
    assert np.abs(held - np.sin(W * (TIME - age))).max() > 5 * np.abs(late - np.sin(W * (TIME - age))).max()
    np.testing.assert_allclose(logged_late(late, DT, -age), np.sin(W * TIME), atol=0.01)


def test_a_skew_makes_one_group_late():
    record = log(
        u=np.sin(W * TIME),
        q=np.sin(W * TIME),
        psi=np.angle(np.exp(1j * TIME)),
        effector__de1=np.sin(W * TIME),
    )
    read = distort("time_skew", record, velocity=0.03, attitude=0.05)
    np.testing.assert_allclose(read["state/u"][5:], np.sin(W * (TIME[5:] - 0.03)), atol=1e-4)
    assert np.array_equal(read["state/q"], record["state/q"])
    assert np.array_equal(read["effector/de1"], record["effector/de1"])
    late = np.exp(1j * (read["state/psi"] - TIME + 0.05))[5:]  # through the jumps of a full turn
    np.testing.assert_allclose(late, 1.0, atol=1e-6)


def test_an_accelerometer_further_out_feels_the_turning():
    record = log(p=0.0, q=0.5 * np.sin(W * TIME), r=0.3, ax=0.0, ay=0.0, az=-9.8)
    read = distort("lever_arm", record, x=0.2, z=-0.1)
    q, qdot = record["state/q"], 0.5 * W * np.cos(W * TIME)
    inside = slice(10, -10)
    # rigid body: a = w' x d + w x (w x d) with d = (0.2, 0, -0.1) and w = (0, q, 0.3)
    expected = (
        -0.1 * qdot - 0.2 * (q**2 + 0.3**2),
        q * 0.3 * -0.1,
        -9.8 - 0.2 * qdot + 0.1 * q**2,
    )
    for name, row in zip(("ax", "ay", "az"), expected, strict=True):
        np.testing.assert_allclose(read[f"state/{name}"][inside], row[inside], atol=2e-3)


def test_upwash_magnifies_flow_angles_and_keeps_the_airspeed():
    record = log(u=20 * np.cos(0.1), v=0.0, w=20 * np.sin(0.1), air__alpha=0.1)
    read = distort("flow_upwash", record, alpha=0.2)
    np.testing.assert_allclose(read["air/alpha"], 0.12)
    np.testing.assert_allclose(
        [read["state/u"][0], read["state/w"][0]], [20 * np.cos(0.12), 20 * np.sin(0.12)]
    )


def test_a_sensor_turned_about_z_to_the_right_reads_a_wind_from_the_front_as_from_the_left():
    record = log(u=20.0, v=0.0, w=0.0, p=0.3, q=0.0, r=0.0, ax=0.0, ay=0.0, az=-9.8)
    read = distort("misalignment", record, velocity_z=0.1, imu_x=0.02)
    np.testing.assert_allclose(
        [read[f"state/{n}"][0] for n in "uvw"], [20 * np.cos(0.1), -20 * np.sin(0.1), 0.0], atol=1e-12
    )
    np.testing.assert_allclose(
        [read[f"state/{n}"][0] for n in ("ay", "az")], [-9.8 * np.sin(0.02), -9.8 * np.cos(0.02)]
    )
    assert read["state/p"][0] == pytest.approx(0.3)


def test_wind_that_was_not_taken_out_is_in_the_velocity_over_the_ground():
    record = log(u=20.0, v=0.0, w=0.0, phi=0.0, theta=0.0, psi=np.pi / 2)  # flying east
    read = distort("steady_wind", record, east=3.0, north=1.0, down=0.5)
    np.testing.assert_allclose([read[f"state/{n}"][0] for n in "uvw"], [23.0, -1.0, 0.5], atol=1e-12)


def test_a_mode_resonates_at_its_frequency_and_follows_below_it():
    def gain(hertz, **changed):
        w = 2 * np.pi * hertz
        record = log(az=np.sin(w * TIME), q=0.0)
        read = distort("flexible_mode", record, strength=0.1, **changed)
        late = slice(1000, None)
        basis = np.stack([np.sin(w * TIME), np.cos(w * TIME)])[:, late]
        added = np.stack([read["state/az"] - record["state/az"], read["state/q"]])[:, late]
        return (added @ np.linalg.pinv(basis)) @ [1, 1j]

    for hertz in (0.5, 2.0, 3.9):
        w, w0, z = 2 * np.pi * hertz, 2 * np.pi * 4.0, 0.05
        y = 1 / (w0**2 - w**2 + 2j * z * w0 * w)
        expected = np.array([0.1 * w**2 * y, 0.5 * 0.1 * 1j * w * y])
        found = gain(hertz, frequency=4.0, damping=z)
        np.testing.assert_allclose(found, expected, rtol=0.03, atol=1e-4)


def test_mass_effects_scale_what_they_name_and_nothing_else():
    def load(identifier, **changed):
        return effects.find(identifier).load(usual(identifier, **changed), VEHICLE)

    for identifier in ("mass", "cg_offset", "inertia", "tilt_inertia"):
        assert load(identifier) == VEHICLE
    stated = VEHICLE.mass_properties
    heavy = load("mass", fraction=0.1).mass_properties
    assert heavy.mass_kg == pytest.approx(1.1 * stated.mass_kg)
    assert (heavy.cg_m, heavy.inertia) == (stated.cg_m, stated.inertia)
    moved = load("cg_offset", x=0.01, z=-0.02).mass_properties
    assert moved.cg_m == pytest.approx((0.10, 0.0, 0.01))
    turned = load("inertia", yy=0.2, xz=0.01).mass_properties.inertia
    assert turned.yy == pytest.approx(1.2 * stated.inertia.yy)
    assert turned.xz == pytest.approx(stated.inertia.xz + 0.01 * np.sqrt(3.1 * 9.2))
    assert turned.xx == stated.inertia.xx
    frozen = load("tilt_inertia", fraction=-1.0)
    assert [w.mass_kg for w in frozen.wings] == [0.0, 0.0]
    assert frozen.mass_properties == stated
    with pytest.raises(UsageError, match=r"effect 'inertia': inertia has principal moments"):
        effects.loaded(VEHICLE, {"inertia": {"xx": -0.5, "yy": 1.0, "zz": 0.0, "xz": 0.0}})


def test_the_centre_of_gravity_goes_with_the_wings():
    level = log(effector__dw1=0.0, effector__dw2=0.0)
    np.testing.assert_allclose(along.centre(level, VEHICLE)[:, 0], VEHICLE.mass_properties.cg_m)
    up = log(effector__dw1=np.pi / 2, effector__dw2=0.0)
    # 4.5 kg turn from 0.06 m ahead of the axis to 0.06 m above it
    shift = 4.5 / 28.6 * np.array([-0.06, 0.0, -0.06])
    np.testing.assert_allclose(
        along.centre(up, VEHICLE)[:, 0], VEHICLE.mass_properties.cg_m + shift, atol=1e-12
    )


def test_settings_know_the_places_of_a_vehicle_and_the_range_of_a_parameter():
    found = effects.settings({"weak_rotor": {"n3": 0.2}}, VEHICLE)
    assert found["weak_rotor"]["n3"] == 0.2
    assert found["weak_rotor"]["loss"] == found["weak_rotor"]["n4"] == 0.0
    with pytest.raises(UsageError, match=r"no parameter 'n9'.*n1"):
        effects.settings({"weak_rotor": {"n9": 0.2}}, VEHICLE)
    with pytest.raises(UsageError, match=r"width is -1, expected 0 to 0\.5"):
        effects.settings({"backlash": -1}, VEHICLE)
    assert effects.find("cg_offset").of(VEHICLE).parameters["x"].scale == pytest.approx(0.03 * 0.33)
    acting = effects.acting(effects.settings({"slipstream": 0, "weak_rotor": {"n3": 0.2}}, VEHICLE))
    assert acting["slipstream"] == {"strength": 0.0}
    assert acting["weak_rotor"] == {"loss": 0.0, "n3": 0.2}
    assert "downwash_lag" not in acting


def test_needs_are_told_in_the_effects_own_words():
    record = log(u=1.0, effector__de1=0.0)
    assert unmet(effects.find("extra_drag"), VEHICLE, record) == ["state/v", "state/w", "air/rho"]
    assert unmet(effects.find("extra_drag"), None) == ["vehicle.area_m2"]
    assert unmet(effects.find("actuator_delay"), VEHICLE, record) == ["command"]
    assert unmet(effects.find("weak_rotor"), VEHICLE, record) == []
