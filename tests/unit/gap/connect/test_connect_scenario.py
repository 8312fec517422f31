"""The scenario's simulation replayed on its own flights, without noise: it must come out as it was."""

from dataclasses import replace

import msgspec
import numpy as np
import pytest

from freqid.core.errors import DataError, UsageError
from freqid.core.record import Channel, Maneuver
from freqid.gap.connect import actuation, loads
from freqid.gap.connect.scenario import ScenarioSimulation
from freqid.gap.model.changes import beside, change
from freqid.gap.simulation import Tolerance
from freqid.gap.stack.trial import Trial
from freqid.simulate.effects import library
from freqid.simulate.maneuver import Conditions, fly_maneuver, with_effects

WRENCH = ("X", "Y", "Z", "L", "M", "N")


@pytest.fixture(scope="module")
def simulation(la8):
    return ScenarioSimulation(la8)


@pytest.mark.parametrize("reference", ["u20", "u62"])
def test_the_replayed_wrench_is_the_one_that_was_flown(simulation, flown, reference):
    flight = flown(reference)
    truth = flight.truth.matrix(f"response/{r}" for r in WRENCH)[:, ::2]
    error = simulation.predict(flight.record) - truth
    rms = np.sqrt((truth**2).mean(axis=1))
    # Before the first sample the inputs were still: what the wake carries from there has a kink.
    assert (np.sqrt((error[:, 25:] ** 2).mean(axis=1)) < 1e-5 * rms).all()
    assert (np.sqrt((error**2).mean(axis=1)) < 2e-4 * rms).all()


def test_what_the_wake_carries_arrives_late(simulation, flown):
    """Without the delay the error is a thousand times larger, so the test above tells."""
    flight = flown("u62")
    record = flight.record
    truth = flight.truth.matrix(f"response/{r}" for r in WRENCH)[:, ::2]
    steady = simulation.predict(replace(record, time=1e3 * record.time))  # so slow that nothing is late
    error = (steady - truth)[4, 25:]
    assert np.sqrt((error**2).mean()) > 1e-3 * np.sqrt((truth[4] ** 2).mean())


def test_a_velocity_sensor_off_the_origin_is_brought_there(simulation, flown):
    record = flown("u20").record
    place = np.array([0.7, -0.2, 0.1])
    moved = (
        record.matrix(("state/u", "state/v", "state/w"))
        + np.cross(record.matrix(("state/p", "state/q", "state/r")).T, place).T
    )
    channels = [
        Channel(f"state/{n}", "m/s", row, 50.0, "moved", tuple(place))
        for n, row in zip("uvw", moved, strict=True)
    ]
    expected, found = simulation.predict(record), simulation.predict(record.with_channels(*channels))
    assert np.allclose(found, expected, rtol=1e-9, atol=1e-8)


def test_settings_of_effects_change_the_prediction_and_unknown_ones_are_refused(simulation, flown):
    record = flown("u20").record
    assert set(simulation.effects) == set(library())
    there = simulation.predict(record)
    same = simulation.predict(record, {"slipstream": {"strength": 1.0}})
    less = simulation.predict(record, {"slipstream": {"strength": 0.5}})
    assert np.array_equal(there, same)
    assert np.abs(less - there)[2].mean() > 1.0
    with pytest.raises(UsageError, match="slipsteam"):
        simulation.predict(record, {"slipsteam": {"strength": 1.0}})


def test_actuators_make_the_positions_that_were_flown(simulation, flown):
    record = flown("u20").record
    found = simulation.positions(record)
    for name, row in found.items():
        flown_there = record[f"effector/{name}"]
        error = np.abs(row - flown_there) / np.abs(flown_there).max()
        assert error[25:].max() < 1e-6, name
        assert error.max() < 1e-4, name  # the inputs start with a kink
    late = simulation.positions(record, {"actuator_delay": {"strength": 3.0}})
    assert np.abs(late["de1"] - found["de1"]).max() > 1e-3
    assert simulation.positions(replace(record, channels={"state/u": record.channel("state/u")})) == {}


def test_positions_need_no_measured_start(simulation, flown):
    """Commands alone do: the actuators then start at rest where their commands hold them."""
    record = flown("u20").record
    bare = replace(
        record, channels={n: c for n, c in record.channels.items() if not n.startswith("effector/")}
    )
    measured, alone = simulation.positions(record), simulation.positions(bare)
    assert alone.keys() == measured.keys()
    for name, row in alone.items():
        assert np.abs(row - measured[name]).max() < 1e-3 * np.abs(measured[name]).max(), name


def test_noise_of_the_logged_voltage_is_no_motion_of_the_rotors(simulation, flown):
    record = flown("u20").record
    blind = replace(record, channels={n: c for n, c in record.channels.items() if n != "power/voltage"})
    np.testing.assert_array_equal(simulation.positions(record)["n1"], simulation.positions(blind)["n1"])


def test_its_own_flight_is_the_record(simulation, flown):
    record = flown("u20").record
    found = simulation.fly(record)
    for name in record.group("state"):
        assert np.abs(found[name] - record[f"state/{name}"]).max() < 1e-9, name


def test_a_flight_that_diverges_says_when(simulation, flown):
    record = flown("u20").record
    strong = [
        replace(record.channel(n), values=60 * record[n]) for n in record.channels if "excitation/d" in n
    ]
    with pytest.raises(DataError, match=r"t = \d"):
        simulation.fly(record.with_channels(*strong))


def test_derivatives_are_those_of_the_prediction(simulation, flown):
    record = flown("u20").record
    names = ["state/w", "effector/de1", "effector/n5", "effector/dw1", "state/phi"]
    found = simulation.gradient(record, names)
    for i, (name, step) in enumerate(zip(names[:4], (1e-2, 1e-3, 0.5, 1e-3), strict=True)):
        above, below = (
            simulation.predict(record.with_channels(replace(record.channel(name), values=record[name] + s)))
            for s in (step, -step)
        )
        slope = ((above - below) / (2 * step))[:, 25:-25]
        strong = np.abs(slope).mean(axis=1) > 0.1 * np.abs(slope).mean(axis=1).max()
        error = np.abs(found[:, i, 25:-25].mean(axis=1) - slope.mean(axis=1))
        assert (error < 0.01 * np.abs(slope).mean(axis=1))[strong].all(), name
    assert not found[:, 4].any()  # attitude is not felt
    with pytest.raises(UsageError, match="de9"):
        simulation.gradient(record, ["effector/de9"])


def test_a_record_that_lacks_an_effector_is_refused(simulation, flown):
    record = flown("u20").record
    short = replace(record, channels={n: c for n, c in record.channels.items() if n != "effector/df3"})
    with pytest.raises(DataError, match="effector/df3"):
        simulation.predict(short)


def test_parts_are_the_sections_that_the_scenario_has(simulation):
    assert {"simulation.airframe.wake", "simulation.actuators.surface"} <= set(simulation.parts)


def test_neither_other_settings_nor_other_lengths_compile_anew(simulation, flown):
    """Beyond the two sizes of chunks, of which a length takes one."""
    record = flown("u20").record
    simulation.predict(record)
    simulation.predict(record.cut(0.0, 7.3))
    compiled = loads._loads._cache_size()
    for end in (5.1, 6.4, 7.3):
        simulation.predict(record.cut(0.0, end), {"slipstream": {"strength": 0.9}})
    assert loads._loads._cache_size() == compiled


def test_lags_and_rate_limits_act_on_positions_as_in_flight(simulation, la8, inputs):
    settings = {
        "actuator_lag": {"extra": 0.05},
        "motor_lag": {"extra": 0.08},
        "rate_limit": {"slowness": 0.5},
    }
    at = la8.reference_of("u45")
    record = fly_maneuver(with_effects(la8, settings), at, inputs, Conditions()).record
    found, plain = simulation.positions(record, settings), simulation.positions(record)
    for name in ("de1", "df3", "n1", "n8"):
        flown_there, size = record[f"effector/{name}"], np.abs(record[f"effector/{name}"]).max()
        assert np.abs(found[name] - flown_there)[25:].max() < 1e-6 * size, name
        assert np.abs(plain[name] - flown_there)[25:].max() > 1e-3 * size, name


def test_motors_are_as_much_slower_as_those_of_another_scenario(simulation, la8, inputs):
    """A motor that is slower is not one with a lag before it."""
    motor = la8.simulation.actuators["motor"]
    longer = {n: 1.4 * motor[n] for n in ("rise_s", "fall_s")}
    actuators = {**la8.simulation.actuators, "motor": {**motor, **longer}}
    slower = msgspec.structs.replace(
        la8, simulation=msgspec.structs.replace(la8.simulation, actuators=actuators)
    )
    settings = {"motor_lag": {"extra": 0.02, "time_constant": 0.05}}
    at = la8.reference_of("u45")
    record, same = (
        fly_maneuver(s, at, inputs, Conditions()).record for s in (slower, with_effects(la8, settings))
    )
    trial = Trial.of(simulation, Maneuver.of(record))
    effect = library()["motor_lag"].of(trial.maneuver.vehicle)
    found = change(effect, trial, settings["motor_lag"])
    one = change(effect, trial, {"n1": 0.02, "time_constant": 0.05})
    ahead = change(effect, trial, {"extra": 0.02})
    inside = beside([(effect, settings["motor_lag"])], trial)
    for i, row in enumerate(found.rows):
        name = row.name.removeprefix("actuator/")
        if name in ("n1", "n8"):
            moved = record[f"effector/{name}"] - trial.positions[name]
            size = np.std(moved[25:])
            assert np.std(record[f"effector/{name}"] - same[f"effector/{name}"]) < 1e-6 * size
            assert np.std((found.direct[i] - moved)[25:]) < 1e-4 * size
            assert np.std((inside.positions[name] - record[f"effector/{name}"])[25:]) < 1e-4 * size
            assert np.std((ahead.direct[i] - moved)[25:]) > 0.05 * size
            np.testing.assert_allclose(one.direct[i], found.direct[i] if name == "n1" else 0.0, atol=1e-12)


def test_a_delay_comes_before_the_voltage_of_the_motors(simulation, la8, inputs):
    """Positions that come late as a whole would carry the voltage of an earlier moment.

    That is 1 % of what a delay changes: a battery's sag would have to make up for it.
    """
    late = with_effects(la8, {"actuator_delay": {"extra": 0.03}})
    record = fly_maneuver(late, la8.reference_of("u20"), inputs, Conditions()).record
    trial = Trial.of(simulation, Maneuver.of(record))
    effect = library()["actuator_delay"].of(trial.maneuver.vehicle)
    found = change(effect, trial, {"extra": 0.03})
    for i, row in enumerate(found.rows):
        if row.name.startswith("actuator/n"):
            missed, all_of_it = (h.direct[i, 25:] for h in (trial.residual - found, trial.residual))
            assert np.std(missed) < 5e-4 * np.std(all_of_it), row.name


def test_a_rotor_that_is_much_weaker_is_not_a_derivative_times_its_loss(simulation, la8, inputs):
    """Thrust goes with the square of the speed: 30 % of it and its derivative are 8 % apart."""
    loss = {"n8": 0.3}
    weak = with_effects(la8, {"weak_rotor": {"loss": 0.0, **loss}})
    record = fly_maneuver(weak, la8.reference_of("u20"), inputs, Conditions()).record
    trial = Trial.of(simulation, Maneuver.of(record))
    effect = library()["weak_rotor"].of(trial.maneuver.vehicle)
    row = next(i for i, r in enumerate(trial.measured.rows) if r.name == "N")

    def missed(found):
        whole = (trial.residual - found).direct[row, 25:]
        return np.abs(np.mean(whole)) / np.abs(np.mean(trial.residual.direct[row, 25:]))

    assert missed(change(effect, trial, loss)) < 0.01
    assert missed(change(effect, trial, loss, first_order=True)) > 0.05


def test_what_acts_on_single_actuators_is_what_acts_on_all_of_them(simulation, la8, flown):
    trial = Trial.of(simulation, Maneuver.of(flown("u45").record))
    names = ("de1", "df3", "n1")
    late = {"de1": 0.02, "df3": 0.05, "n1": 0.01}
    effects = {i: e.of(trial.maneuver.vehicle) for i, e in library().items()}
    many = change(effects["actuator_delay"], trial, late)
    inside = beside([(effects["actuator_delay"], late)], trial)
    lag = change(effects["motor_lag"], inside, {"extra": 0.04})
    for name in names:
        row = next(i for i, r in enumerate(many.rows) if r.name == f"actuator/{name}")
        alone = change(effects["actuator_delay"], trial, {name: late[name]})
        np.testing.assert_allclose(many.direct[row], alone.direct[row], atol=1e-12)
        np.testing.assert_allclose(
            inside.positions[name] - trial.positions[name], many.direct[row], atol=1e-12
        )
    settings = {"actuator_delay": {"extra": 0.01}, "motor_lag": {"extra": 0.04}}
    both = simulation.positions(trial.maneuver.record, settings)["n1"]
    row = next(i for i, r in enumerate(lag.rows) if r.name == "actuator/n1")
    np.testing.assert_allclose(inside.positions["n1"] + lag.direct[row], both, atol=1e-9)


def test_a_strong_rate_limit_acts_inside_the_servo(simulation, la8, inputs):
    """The rate in the loop approaches its limit and stays below, unlike a limit behind the servo."""
    settings = {"rate_limit": {"slowness": 2.5}}
    record = fly_maneuver(with_effects(la8, settings), la8.reference_of("u45"), inputs, Conditions()).record
    limited, plain = (simulation.positions(record, s)["de1"] for s in (settings, None))
    assert np.std(limited - record["effector/de1"]) < 1e-4 * np.std(plain - record["effector/de1"])


def test_departures_are_those_of_the_described_numbers(simulation, la8, flown):
    record = flown("u45").record
    steeper = msgspec.json.decode(msgspec.json.encode(la8.simulation.airframe))
    steeper["aerofoil"]["lift_slope"] *= 1.05
    changed = msgspec.structs.replace(
        la8, simulation=msgspec.structs.replace(la8.simulation, airframe=steeper)
    )
    expected = ScenarioSimulation(changed).predict(record)
    assert np.allclose(simulation.predict(record, departures={"aerofoil.lift_slope": 0.05}), expected)
    assert np.abs(expected - simulation.predict(record))[2].mean() > 1.0
    there = simulation.predict(record, departures={"de1.gain": 0.1})  # of actuators: not felt
    assert np.array_equal(there, simulation.predict(record))


def test_departures_of_actuators_move_positions_and_compile_nothing(simulation, flown):
    record = flown("u45").record
    plain = simulation.positions(record)
    compiled = actuation._followed._cache_size()
    slow = simulation.positions(record, departures={"de1.natural_frequency": -0.1})
    assert np.abs(slow["de1"] - plain["de1"]).max() > 1e-3
    assert np.array_equal(slow["de2"], plain["de2"])
    gain = simulation.positions(record, departures={"n3.gain": 0.01})
    assert np.allclose(gain["n3"], 1.01 * plain["n3"], rtol=1e-3)
    late = simulation.positions(record, departures={"surface.delay": 0.01})
    assert np.abs(late["df1"] - plain["df1"]).max() > 1e-3
    assert np.array_equal(late["n1"], plain["n1"])
    assert actuation._followed._cache_size() == compiled


def test_many_departures_are_cheap(simulation, flown):
    record = flown("u45").record
    names = [n for n in simulation.tolerances if n.startswith(("aerofoil", "propeller", "tail", "surface"))]
    simulation.predict(record, departures={names[0]: 0.01})
    compiled = loads._loads._cache_size()
    for name in names:
        simulation.predict(record, departures={name: simulation.tolerances[name].sigma})
    assert len(names) > 30
    assert loads._loads._cache_size() == compiled


def test_a_flight_with_departures_starts_from_its_own_trim(simulation, flown):
    """With another gain, the same position needs another command; with a steeper wing, another angle."""
    record = flown("u45").record
    plain = simulation.fly(record)
    gain = simulation.fly(record, departures={"de1.gain": 0.1})
    assert gain["effector/de1"][0] == pytest.approx(plain["effector/de1"][0], abs=1e-6)
    injected = record["excitation/de1"][0]
    trim, off = (f["command/de1"][0] - injected for f in (plain, gain))
    assert off == pytest.approx(trim / 1.1, rel=1e-6)
    assert np.ptp(gain["effector/de1"]) > 1.03 * np.ptp(plain["effector/de1"])
    steeper = simulation.fly(record, departures={"aerofoil.lift_slope": 0.05})
    change = steeper["w"] - plain["w"]
    assert abs(change.mean()) > 0.05
    assert change.std() < 0.2 * abs(change.mean())  # no transient from one trim to the other


def test_tolerances_are_of_every_number_and_the_scenario_replaces_them(la8):
    tolerances = ScenarioSimulation(la8).tolerances
    assert tolerances["aerofoil.lift_slope"] == Tolerance(0.05, "1", loads_only=True)
    assert tolerances["wing.front.span_m"] == Tolerance(0.01, "1", loads_only=True)
    assert tolerances["de1.natural_frequency"] == Tolerance(0.05, "1", "de1", of_make=True)
    assert tolerances["n8.time_constant"] == Tolerance(0.05, "1", "n8", of_make=True)
    assert tolerances["dw1.gain"] == Tolerance(0.01, "1", "dw1", of_make=True)
    assert tolerances["motor.delay"] == Tolerance(0.002, "s")
    assert "tail.incidence_rad" not in tolerances  # zero: a share of it is nothing
    sigmas = {"aerofoil.lift_slope": 0.02, "mass": 0.01, "n8.time_constant": 0.05}
    changed = ScenarioSimulation(msgspec.structs.replace(la8, tolerance=sigmas)).tolerances
    assert changed["aerofoil.lift_slope"].sigma == 0.02
    assert not changed["n8.time_constant"].of_make  # who states it has said what this one is off by
    assert "mass" not in changed
    for sigma in (-0.1, float("nan"), 3.0):
        absurd = msgspec.structs.replace(la8, tolerance={"aerofoil.lift_slope": sigma})
        with pytest.raises(DataError, match=r"\[tolerance\] aerofoil.lift_slope"):
            _ = ScenarioSimulation(absurd).tolerances


def test_an_unknown_parameter_is_refused(simulation, flown):
    for ask in (simulation.predict, simulation.positions, simulation.fly):
        with pytest.raises(UsageError, match=r"did you mean 'aerofoil\.lift_slope'"):
            ask(flown("u45").record, departures={"aerofoil.lift_slop": 0.05})


def test_what_is_said_to_move_loads_only_moves_no_actuator(simulation, flown):
    record = flown("u20").record
    nominal = simulation.positions(record)
    names = [n for n, t in simulation.tolerances.items() if t.loads_only]
    assert {"aerofoil.lift_slope", "wing.front.span_m", "fuselage.drag_area_m2"} <= set(names)
    assert "propeller.torque" not in names
    moved = simulation.positions(record, departures=dict.fromkeys(names, 0.05))
    for name, x in nominal.items():
        np.testing.assert_allclose(moved[name], x, rtol=1e-9, atol=1e-9, err_msg=name)
    loaded = simulation.positions(record, departures={"propeller.torque": 0.05})
    assert np.abs(loaded["n1"] - nominal["n1"]).max() > 0.1


def test_sensitivities_are_what_full_predictions_differ_by(simulation, flown):
    record = flown("u45").record
    every = slice(None, None, 2)  # as blocks of a stack are thinned
    channels = {n: replace(c, values=c.values[every]) for n, c in record.channels.items()}
    thin = replace(record, time=record.time[every], channels=channels)
    sizes = {"wing.front.span_m": 0.01, "wake.downwash": 0.05, "propeller.thrust": 0.05, "de1.gain": 0.01}
    found = simulation.sensitivity(thin, sizes)
    for (name, size), moved in zip(sizes.items(), found, strict=True):
        above, below = (simulation.predict(thin, departures={name: sign * size}) for sign in (1, -1))
        expected = (above - below) / 2
        error = (moved - expected)[:, 12:]  # the inputs start with a kink
        assert np.linalg.norm(error) <= 3e-4 * np.linalg.norm(expected), name
