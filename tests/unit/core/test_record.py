from dataclasses import replace

import numpy as np
import pytest

from freqid.core.errors import DataError, UsageError
from freqid.core.record import Channel, FlightRecord, Maneuver, check_time, read_record, write_record
from freqid.core.scenario import read_scenario
from freqid.core.vehicle import Inertia, MassProperties, Rotor, Vehicle


def record(time=None, **values):
    time = np.arange(501) * 0.02 if time is None else time
    channels = {
        n.replace("__", "/"): Channel(n.replace("__", "/"), "m/s", v, 50.0, "test") for n, v in values.items()
    }
    return FlightRecord(time, channels)


def test_a_channel_is_found_by_group_and_name_and_a_slip_is_suggested():
    flight = record(state__u=np.ones(501), state__w=np.zeros(501))
    assert flight.matrix(["state/w", "state/u"]).shape == (2, 501)
    assert flight.group("state") == ("u", "w")
    with pytest.raises(DataError, match="'state/U' is missing; did you mean"):
        flight["state/U"]


def test_clock_of_seconds_of_day_is_uniform_despite_its_rounding():
    check_time(np.round(54813.06 + 0.02 * np.arange(1001), 2))


@pytest.mark.parametrize(
    ("spoil", "says"),
    [
        (lambda t: np.delete(t, [100, 101]), "not uniform: 0.06 s after t = 1.98 s"),
        (lambda t: np.insert(t, 50, t[50]), "repeats at sample 51"),
        (lambda t: np.where(np.arange(t.size) == 70, t[68], t), "runs backward at sample 70"),
        (lambda t: np.where(np.arange(t.size) == 7, np.nan, t), "not finite at sample 7"),
        (lambda t: t[:1], "at least two samples"),
    ],
)
def test_a_bad_clock_is_refused_with_its_place(spoil, says):
    with pytest.raises(DataError, match=says):
        check_time(spoil(np.arange(501) * 0.02))


def test_a_sample_that_is_not_finite_is_refused_with_its_time():
    values = np.ones(501)
    values[250] = np.inf
    with pytest.raises(DataError, match=r"'state/u' is not finite in 1 of 501 samples, first at t = 5 s"):
        record(state__u=values)


def test_a_cut_keeps_both_ends_and_says_so():
    flight = record(state__u=np.arange(501.0)).cut(2.0, 4.0)
    assert flight.time[[0, -1]] == pytest.approx([2.0, 4.0])
    assert flight["state/u"][[0, -1]].tolist() == [100, 200]
    assert flight.provenance["cut_s"] == [2.0, 4.0]
    with pytest.raises(UsageError, match="not inside the record, which runs 2:4 s"):
        flight.cut(1.0, 3.0)


def test_the_records_own_mass_overrides_the_vehicles():
    def body(mass_kg):
        return MassProperties(mass_kg=mass_kg, inertia=Inertia(xx=2, yy=3, zz=4))

    flight = record(state__u=np.arange(501.0))
    with pytest.raises(DataError, match="does not describe its vehicle"):
        Maneuver.of(flight)
    vehicle = Vehicle(name="x", mass_properties=body(10.0))
    assert Maneuver.of(flight, vehicle).vehicle.mass_properties.mass_kg == 10.0
    weighed = FlightRecord(flight.time, flight.channels, vehicle, mass_properties=body(11.0))
    assert Maneuver.of(weighed, span=(1.0, 2.0)).vehicle.mass_properties.mass_kg == 11.0


def test_a_source_whose_bytes_are_not_utf8_is_written(tmp_path):
    """The name of the log, as the system gives it."""
    channel = Channel("state/q", "rad/s", np.zeros(3), 50.0, "fl\udcfcg.csv: q")
    write_record(tmp_path / "named.h5", FlightRecord(0.02 * np.arange(3), {"state/q": channel}))
    assert read_record(tmp_path / "named.h5").channels["state/q"].source == "fl\ufffdg.csv: q"


@pytest.mark.parametrize(
    ("asked", "said"), [("state/r", "map the column that holds it"), ("state/Q", "did you mean 'state/q'")]
)
def test_a_channel_that_is_missing_has_no_stand_in(asked, said):
    record = FlightRecord(np.arange(3.0), {"state/q": Channel("state/q", "rad/s", np.zeros(3), 1.0, "made")})
    with pytest.raises(DataError, match=said):
        record.channel(asked)


def test_channels_that_are_replaced_are_checked_and_the_record_is_another_one():
    before = record(state__u=np.ones(501), state__w=np.zeros(501))
    channel = before.channel("state/u")
    after = before.with_channels(replace(channel, values=channel.values + 1.0))
    assert after.matrix(["state/u", "state/w"])[:, 0].tolist() == [2.0, 0.0]
    assert after.fingerprint != before.fingerprint
    assert after.with_channels(channel).fingerprint == before.fingerprint
    with pytest.raises(DataError, match="is not finite in 1 of"):
        before.with_channels(replace(channel, values=np.where(before.time == before.time[1], np.nan, 0.0)))
    with pytest.raises(DataError, match="has shape"):
        before.with_channels(replace(channel, values=channel.values[:-1]))


def test_a_vehicle_that_no_file_could_give_back_is_not_written(tmp_path):
    la8, _ = read_scenario("la8")
    flight = replace(record(state__u=np.ones(501)), vehicle=la8.vehicle)
    with pytest.raises(UsageError, match=r"is a Airframe, expected a Vehicle"):
        write_record(tmp_path / "flight.h5", flight)
    assert not list(tmp_path.iterdir())
    write_record(tmp_path / "flight.h5", replace(flight, vehicle=la8.aircraft()))
    assert read_record(tmp_path / "flight.h5").vehicle == la8.aircraft()


def test_a_vehicle_of_numpys_numbers_is_written_as_any_other(tmp_path):
    hub = np.array([0.1, 0.2, -0.3])
    body = MassProperties(mass_kg=np.float64(9), inertia=Inertia(xx=np.float32(1), yy=1.0, zz=1.0))
    rotor = Rotor(name="n1", spin=1, inertia=0.0, position_m=tuple(hub))
    vehicle = Vehicle(name="made", mass_properties=body, rotors=(rotor,))
    write_record(tmp_path / "flight.h5", replace(record(state__u=np.ones(501)), vehicle=vehicle))
    read = read_record(tmp_path / "flight.h5").vehicle
    assert read.mass_properties.mass_kg == 9.0
    assert read.rotors[0].position_m == (0.1, 0.2, -0.3)


def test_arrays_become_a_record_in_si_units():
    t = np.arange(0, 10, 0.02)
    vehicle = read_scenario("la8")[0].aircraft()
    surface = next(n for n, kind in vehicle.effector_kinds.items() if kind == "surface")
    made = FlightRecord.of(
        t.tolist(),
        {"state/q": 5 * np.sin(t), "air/rho": 1.2, f"effector/{surface}": np.cos(t), "state/ax": t},
        vehicle,
        units={"state/q": "deg/s"},
        positions_m={"state/ax": (0.1, 0.0, -0.2)},
        reference="cruise",
    )
    np.testing.assert_allclose(made["state/q"], np.radians(5 * np.sin(t)))
    np.testing.assert_array_equal(made["air/rho"], np.full(t.size, 1.2))
    assert made.channel(f"effector/{surface}").unit == "rad"
    assert made.channel("state/ax").position_m == (0.1, 0.0, -0.2)
    assert made.channel("state/q").native_rate_hz == pytest.approx(50.0)
    assert made.reference == "cruise"


@pytest.mark.parametrize(
    ("values", "given", "says"),
    [
        ({"effector/de": 0.0}, {}, "the unit of 'effector/de' is not known"),
        ({"state/q": 0.0}, {"units": {"state/p": "deg"}}, "there are no values of 'state/p'"),
        ({"state/q": 0.0}, {"positions_m": {"state/r": (0, 0, 0)}}, "there are no values of 'state/r'"),
        ({"state/q": 0.0}, {"units": {"state/q": "m"}}, "unit 'm', expected a unit that converts to 'rad/s'"),
        ({"state/q": np.zeros(3)}, {}, "has shape"),
        ({"state/q": 0.0}, {"vehicle": {"name": "a table"}}, "expected a Vehicle"),
    ],
)
def test_arrays_that_make_no_record_are_refused(values, given, says):
    with pytest.raises((DataError, UsageError), match=says):
        FlightRecord.of(np.arange(0, 10, 0.02), values, **given)
