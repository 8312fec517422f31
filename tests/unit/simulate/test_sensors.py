from pathlib import Path

import msgspec
import numpy as np
import pytest

from freqid.core.channels import si_unit
from freqid.core.errors import DataError, UsageError
from freqid.core.record import Channel, FlightRecord
from freqid.core.scenario import read_scenario
from freqid.simulate.sensors import Sensor, measure, suite

SCENARIO = read_scenario(Path(__file__).parents[3] / "scenarios" / "la8.toml")[0]
VEHICLE = SCENARIO.aircraft()
TIME = np.arange(2001) * 0.005
CALM = np.zeros((3, TIME.size))


def truth(**values):
    """A flight along x at 20 m/s, all else zero or as given (``state_q`` for ``state/q``)."""
    names = [f"state/{n}" for n in ("u", "v", "w", "p", "q", "r", "phi", "theta", "psi", "ax", "ay", "az")]
    names += [
        "state/pdot",
        "state/qdot",
        "state/rdot",
        "state/alt",
        "air/rho",
        "power/voltage",
        "power/current",
    ]
    names += [f"air/{n}" for n in ("V", "alpha", "beta")]
    names += [
        f"{group}/{e.name}" for e in VEHICLE.effectors for group in ("effector", "command", "excitation")
    ]
    signals = {name: np.zeros(TIME.size) for name in names} | {"state/u": np.full(TIME.size, 20.0)}
    signals |= {key.replace("_", "/", 1): np.asarray(x) + np.zeros(TIME.size) for key, x in values.items()}
    unit = lambda name: si_unit(name, VEHICLE.effector_kinds) or ""  # noqa: E731
    channels = {n: Channel(n, unit(n), x, 200.0, "truth") for n, x in signals.items()}
    return FlightRecord(TIME, channels, VEHICLE, reference="cruise", provenance={"made": "here"})


def logged(sensor, flight=None, wind=CALM, rate=100.0, seed=0):
    return measure(flight or truth(), wind, {"probe": sensor}, rate, seed)


def test_a_perfect_sensor_logs_the_truth():
    flight = truth(state_q=np.sin(3.0 * TIME))
    record = logged(Sensor(channels=("state/q",), rate_hz=100.0), flight)
    assert np.allclose(record["state/q"], np.sin(3.0 * record.time), atol=1e-7)
    assert record.channel("state/q").native_rate_hz == 100.0
    assert record.channel("state/q").source == "simulated probe"
    assert record.reference == "cruise"
    assert record.provenance == {"made": "here", "sensor_seed": 0}


def test_errors_have_their_stated_size():
    sensor = Sensor(channels=("state/q",), rate_hz=100.0, noise=0.2, bias=0.5, scale=0.1)
    wave = truth(state_q=3.0 * np.sign(np.sin(TIME)))
    runs = np.array([logged(sensor, wave, seed=s)["state/q"] for s in range(150)])
    up, down = (runs[:, np.sign(np.sin(np.arange(1001) * 0.01)) == sign].mean(axis=1) for sign in (1, -1))
    assert np.std((up + down) / 2) == pytest.approx(0.5, rel=0.25)  # 150 draws: 6 % one sigma
    assert np.std((up - down) / 2) == pytest.approx(0.3, rel=0.25)
    assert np.median(np.abs(np.diff(runs))) / 0.6745 / np.sqrt(2) == pytest.approx(0.2, rel=0.02)


def test_a_slow_sensor_is_late_and_straight_between_its_samples():
    flight = truth(effector_n1=500.0 + 40.0 * TIME)
    record = logged(Sensor(channels=("effector/n1",), rate_hz=10.0, latency_s=0.05), flight)
    late = record.time > 0.1
    assert np.allclose(record["effector/n1"][late], 500.0 + 40.0 * (record.time[late] - 0.05), atol=1e-9)
    corner = truth(effector_n1=np.where(TIME < 0.25, 0.0, 100.0))
    ramp = logged(Sensor(channels=("effector/n1",), rate_hz=10.0), corner)["effector/n1"]
    assert ramp[25] == pytest.approx(0.5 * (ramp[20] + ramp[30]))
    assert record.channel("effector/n1").native_rate_hz == 10.0


def test_digits_come_in_steps():
    record = logged(Sensor(channels=("state/theta",), rate_hz=100.0, quantum=0.25), truth(state_theta=TIME))
    assert set(np.unique(record["state/theta"] / 0.25 % 1)) == {0.0}
    assert np.max(np.abs(record["state/theta"] - record.time)) <= 0.125 + 1e-12


def test_an_accelerometer_off_the_origin_feels_the_turning_by_hand():
    # r = (1, 0, 0), q = 2, qdot = 3: centripetal -q^2 r along x, tangential -qdot r along z.
    flight = truth(state_q=2.0, state_qdot=3.0, state_az=-9.8)
    sensor = Sensor(channels=("state/ax", "state/ay", "state/az"), rate_hz=100.0, position_m=(1.0, 0.0, 0.0))
    record = logged(sensor, flight)
    assert np.allclose(record.matrix(("state/ax", "state/ay", "state/az")).T, [-4.0, 0.0, -9.8 - 3.0])
    assert record.channel("state/ax").position_m == (1.0, 0.0, 0.0)
    at_origin = logged(Sensor(channels=("state/ax",), rate_hz=100.0), flight).channel("state/ax")
    assert at_origin.position_m == (0.0, 0.0, 0.0)  # said, because none means the centre of gravity


def test_vanes_feel_upwash_and_the_turning_at_their_place():
    flight = truth(state_w=2.0, state_q=0.5)
    sensor = Sensor(channels=("air/alpha",), rate_hz=100.0, upwash=0.1, position_m=(1.2, 0.0, 0.0))
    expected = 1.1 * np.arctan2(2.0 - 0.5 * 1.2, 20.0)
    assert np.allclose(logged(sensor, flight)["air/alpha"], expected)


def test_a_ground_velocity_is_north_east_down_and_has_the_wind_in_it():
    # Nose east, 30 deg up, banked: rotations one after another, written out.
    turns = (0.4, np.pi / 6, np.pi / 2)
    cf, sf, ct, st = np.cos(turns[0]), np.sin(turns[0]), np.cos(turns[1]), np.sin(turns[1])
    roll = np.array([[1, 0, 0], [0, cf, -sf], [0, sf, cf]])
    pitch = np.array([[ct, 0, st], [0, 1, 0], [-st, 0, ct]])
    yaw = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
    flight = truth(state_phi=turns[0], state_theta=turns[1], state_psi=turns[2], state_q=0.5)
    wind = np.array([[3.0], [-2.0], [1.0]]) + CALM
    place = (0.0, 0.0, 2.0)
    names = ("state/vn", "state/ve", "state/vd")
    record = logged(Sensor(channels=names, rate_hz=100.0, senses="ground", position_m=place), flight, wind)
    expected = yaw @ pitch @ roll @ (np.array([20.0 + 0.5 * 2.0, 0, 0]) + wind[:, 0])
    assert np.allclose(record.matrix(names), expected[:, None])
    assert "state/u" not in record
    for channel in ("state/u", "air/V"):
        with pytest.raises(ValueError, match=f"'{channel}' is relative to the air, but senses is 'ground'"):
            Sensor(channels=(channel,), rate_hz=100.0, senses="ground")
    with pytest.raises(ValueError, match="'state/vn' is over the ground, but senses is 'air'"):
        Sensor(channels=("state/vn",), rate_hz=100.0)


def test_a_pitot_tube_meets_only_what_comes_from_ahead_and_is_blind_below_its_speed():
    flight = truth(state_u=12.0 - 1.0 * TIME, state_w=9.0)
    sensor = Sensor(channels=("air/V",), rate_hz=50.0, senses="tube", blind_below=6.0, noise=0.01)
    record = logged(sensor, flight)
    seeing = record.time < 5.95
    assert np.allclose(record["air/V"][seeing], 12.0 - record.time[seeing], atol=0.06)
    assert np.all(record["air/V"][record.time > 6.05] == 0.0)


def test_commands_and_excitation_are_known_exactly():
    flight = truth(command_de1=np.floor(20 * TIME), excitation_de1=np.sin(TIME))
    record = logged(Sensor(channels=("state/p",), rate_hz=20.0), flight, rate=40.0)
    assert np.array_equal(record["command/de1"], np.floor(20 * record.time + 1e-6))
    assert np.allclose(record["excitation/de1"], np.sin(record.time))
    assert "effector/de1" not in record  # nothing measures it


def test_one_more_sensor_changes_no_other():
    one = {"gyro": Sensor(channels=("state/p",), rate_hz=100.0, noise=0.1)}
    two = {"horizon": Sensor(channels=("state/phi",), rate_hz=50.0, noise=0.1), **one}
    alone, together = (measure(truth(), CALM, sensors, 100.0, 5) for sensors in (one, two))
    assert np.array_equal(alone["state/p"], together["state/p"])
    assert not np.allclose(together["state/p"], together["state/phi"])


def test_heading_through_south_stays_smooth():
    turning = truth(state_psi=np.angle(np.exp(1j * (3.0 + 0.2 * TIME))))
    record = logged(Sensor(channels=("state/psi",), rate_hz=100.0), turning)
    assert np.allclose(record["state/psi"], 3.0 + 0.2 * record.time, atol=1e-9)


@pytest.mark.parametrize("name", ["research", "owner"])
def test_the_suites_of_the_scenario_log_what_identification_needs(name):
    record = measure(truth(), CALM, suite(SCENARIO, name), 100.0, 0)
    effectors = {f"effector/{e.name}" for e in VEHICLE.effectors}
    velocity = ("u", "v", "w") if name == "research" else ("vn", "ve", "vd")  # GPS sees the ground only
    states = (*velocity, "p", "q", "r", "phi", "theta", "psi", "ax", "ay", "az", "alt")
    wanted = {f"state/{n}" for n in states}
    assert wanted | effectors | {"air/rho", "air/V"} <= set(record.channels)
    assert ("air/alpha" in record) == (name == "research")  # nobody owns vanes
    assert 10 <= record.channel("effector/n1").native_rate_hz <= 100


def test_the_noise_of_the_scenario_is_that_of_the_research_suite():
    kinds = {"surface": "effector/surface", "rotor": "effector/rotor"}
    of = {c: s.noise for s in suite(SCENARIO, "research").values() for c in s.channels}
    assert {n: of[kinds.get(n, f"state/{n}")] for n in SCENARIO.noise} == SCENARIO.noise


def with_sensors(**suites):
    return msgspec.structs.replace(
        SCENARIO, simulation=msgspec.structs.replace(SCENARIO.simulation, sensors=suites)
    )


def test_wrong_suites_are_explained():
    with pytest.raises(UsageError, match=r"no sensor suite 'reserch'; did you mean 'research'"):
        suite(SCENARIO, "reserch")
    gyro = {"channels": ["state/p"], "rate_hz": 100.0}
    with pytest.raises(UsageError, match=r"channel 'state/p' is logged by both 'a' and 'b'"):
        suite(with_sensors(mine={"a": gyro, "b": gyro}), "mine")
    with pytest.raises(UsageError, match=r"key 'latency' is unknown"):
        suite(with_sensors(mine={"a": {**gyro, "latency": 0.1}}), "mine")
    with pytest.raises(UsageError, match=r"channel 'state/pp' is unknown; did you mean"):
        suite(with_sensors(mine={"a": {"channels": ["state/pp"], "rate_hz": 9.0}}), "mine")
    with pytest.raises(DataError, match=r"channel 'air/mach' is missing"):
        logged(Sensor(channels=("air/mach",), rate_hz=1.0))
