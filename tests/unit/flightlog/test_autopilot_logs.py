"""PX4 and ArduPilot logs by the maps that come with freqid: rates, axes, rotors, chirps, faults."""

from __future__ import annotations

import sys

import numpy as np
import pytest
from autopilot_logs import dataflash_bytes, ulog_bytes, write_ulog
from scipy.spatial.transform import Rotation

from freqid.core.errors import DataError, UsageError
from freqid.flightlog.column_map import SHIPPED, find_map, read_column_map
from freqid.flightlog.read import read_log

SECONDS = 30.0


def at(rate, start=5.0):
    return start + np.arange(round(SECONDS * rate)) / rate


def angles(t):
    return np.array([0.1 * np.sin(t), 0.05 * np.cos(0.7 * t), 0.4 * np.sin(0.3 * t)])


def air_velocity(t):
    return np.array([15 + np.sin(0.5 * t), 0.5 * np.cos(t), 1 + 0.2 * np.sin(t)])


WIND = np.array([3.0, -1.0, 0.0])


def ground(t):
    return Rotation.from_euler("ZYX", angles(t)[::-1].T).apply(air_velocity(t).T).T + WIND[:, None]


def px4_topics(*, telemetry=True):
    f4 = np.float32
    fast, attitude, position, slow = at(250), at(100, 5.003), at(50, 5.007), at(10, 5.011)
    x, y, z, w = Rotation.from_euler("ZYX", angles(attitude)[::-1].T).as_quat().T
    velocity = ground(position)
    rates = {f"xyz_{i}": f4(0.1 * np.sin(fast + i)) for i in range(3)}
    topics = [
        ("vehicle_angular_velocity", 0, fast, {f"xyz[{i}]": rates[f"xyz_{i}"] for i in range(3)}),
        ("vehicle_acceleration", 0, fast, {f"xyz[{i}]": f4(i - 9.8 + 0 * fast) for i in range(3)}),
        ("vehicle_attitude", 0, attitude, {f"q[{i}]": f4(q) for i, q in enumerate((w, x, y, z))}),
        ("vehicle_local_position", 0, position, dict(zip(("vx", "vy", "vz"), f4(velocity), strict=True))),
        ("wind", 0, slow, {"windspeed_north": f4(3 + 0 * slow), "windspeed_east": f4(-1 + 0 * slow)}),
        ("battery_status", 0, slow, {"voltage_v": f4(16 - 0.05 * slow), "current_a": f4(10 + 0 * slow)}),
        ("battery_status", 1, slow, {"voltage_v": f4(5 + 0 * slow), "current_a": f4(1 + 0 * slow)}),
        (
            "actuator_motors",
            0,
            attitude,
            {f"control[{i}]": f4(0.5 + 0.1 * np.sin(attitude)) for i in range(4)},
        ),
    ]
    if telemetry:
        rpm = {f"esc[{i}].esc_rpm": np.int32(5000 + 300 * np.sin(slow)) for i in range(4)}
        topics.append(("esc_status", 0, slow, rpm))
    return topics


ABOUT = {"info": (("sys_uuid", "0042"), ("ver_sw", "abc123")), "parameters": (("MC_ROLL_P", 6.5),)}


def ulog_of(path, topics, **about):
    # pyulog's writer knows no nested or array names in subscriptions: fields are flattened on the way in.
    path.write_bytes(ulog_bytes(topics, **(about or ABOUT)))
    return path


def test_a_px4_log_is_read_by_the_map_of_its_kind(tmp_path):
    path = ulog_of(tmp_path / "x.ulg", px4_topics())
    record = read_log(path, "px4-multirotor", resample_hz=50.0)
    inside = (record.time > 8) & (record.time < 31)
    t = record.time
    np.testing.assert_allclose(
        record.matrix(["state/p", "state/q", "state/r"])[:, inside],
        0.1 * np.sin(t + np.arange(3)[:, None])[:, inside],
        atol=1e-5,
    )
    found = record.matrix(["state/phi", "state/theta", "state/psi"])
    np.testing.assert_allclose(found[:, inside], angles(t)[:, inside], atol=1e-5)
    velocity = record.matrix(["state/u", "state/v", "state/w"])
    np.testing.assert_allclose(velocity[:, inside], air_velocity(t)[:, inside], atol=2e-3)
    speed = record["effector/n1"] * 30 / np.pi
    np.testing.assert_allclose(speed[inside], (5000 + 300 * np.sin(t))[inside], atol=3)
    assert "ESC telemetry esc_status.esc[0].esc_rpm" in record.channel("effector/n1").source
    assert "effector/n5" not in record
    assert record.channel("effector/n1").native_rate_hz == pytest.approx(10)
    assert record.configuration.tail == "0042"
    assert record.configuration.firmware == "abc123"
    assert len(record.configuration.parameter_hash) == 16
    assert "air/rho" in record.provenance["not_logged"]
    assert record.provenance["clocks"]["vehicle_attitude"] == "timestamp"


def test_without_telemetry_rotor_speeds_are_commands_times_voltage(tmp_path):
    path = ulog_of(tmp_path / "x.ulg", px4_topics(telemetry=False))
    record = read_log(path, "px4-quadplane", resample_hz=50.0)
    channel = record.channel("effector/n2")
    assert channel.unit == "1"
    assert (
        "no ESC telemetry: command actuator_motors.control[1] times battery_status.voltage_v"
        in channel.source
    )
    slow = at(10, 5.011)
    expected = (0.5 + 0.1 * np.sin(record.time)) * (16 - 0.05 * record.time) / (16 - 0.05 * slow).mean()
    inside = (record.time > 8) & (record.time < 31)
    np.testing.assert_allclose(channel.values[inside], expected[inside], atol=1e-4)


def test_the_time_of_measurement_is_taken_where_it_is_logged(tmp_path):
    t = at(100)
    fields = {"timestamp_sample": np.uint64(np.rint(1e6 * (t - 0.006)))}
    fields |= {f"xyz[{i}]": np.float32(np.sin(t - 0.006)) for i in range(3)}
    topics = [("vehicle_angular_velocity", 0, t, fields), *px4_topics()[1:]]
    record = read_log(ulog_of(tmp_path / "x.ulg", topics), "px4-multirotor", resample_hz=50.0)
    inside = (record.time > 8) & (record.time < 31)
    np.testing.assert_allclose(record["state/p"][inside], np.sin(record.time)[inside], atol=1e-5)
    assert record.provenance["clocks"]["vehicle_angular_velocity"] == "timestamp_sample"


def test_what_pyulog_writes_is_read(tmp_path):
    t = at(100)
    write_ulog(tmp_path / "x.ulg", [("one", 0, t, {"a": np.float64(np.sin(t))})], **ABOUT)
    (tmp_path / "map.toml").write_text('[[channel]]\nname = "state/q"\ncolumn = "one.a"\nunit = "rad/s"\n')
    record = read_log(tmp_path / "x.ulg", tmp_path / "map.toml")
    np.testing.assert_array_equal(record["state/q"], np.sin(t))


def test_faults_of_a_ulog_are_one_sentence_each(tmp_path):
    whole = ulog_bytes(px4_topics(), **ABOUT)
    path = tmp_path / "x.ulg"

    def said(content, **options):
        path.write_bytes(content)
        with pytest.raises(DataError) as caught:
            read_log(path, "px4-multirotor", resample_hz=50.0, **options)
        assert caught.value.where == str(path)
        assert caught.value.exit_code == 3
        return str(caught.value)

    assert "is truncated: it ends inside the message at byte" in said(whole[:-7])
    path.write_bytes(whole[: len(whole) * 2 // 3])
    assert read_log(path, "px4-multirotor", resample_hz=50.0, cut=(6.0, 15.0)).time[-1] < 15.1
    other = ulog_bytes(px4_topics(), info=(("sys_uuid", "0043"),))
    assert "logs of two vehicles are mixed ('0042' and '0043')" in said(whole + other)
    assert "two logs are joined" in said(whole + whole)
    topics = px4_topics()
    assert "topic 'wind' instance 0 is logged twice" in said(ulog_bytes([*topics, topics[4]]))
    assert "is no ULog file" in said(b"rubbish" + whole)
    after_flags = 16 + 3 + 40
    damaged = whole[: after_flags + 2] + b"\xff" + whole[after_flags + 3 :]
    assert f"is damaged at byte {after_flags}: a message of unknown type 255" in said(damaged)
    path.write_bytes(whole)
    with pytest.raises(UsageError, match="--map px4-multirotor"):
        read_log(path)


def test_time_that_runs_backward_is_refused(tmp_path):
    time = np.array([*at(50)[:200], *at(50)[150:400]])
    head = ulog_bytes([("one", 0, time[:200], {"a": np.float32(time[:200])})])
    tail = ulog_bytes([("one", 0, time[200:], {"a": np.float32(time[200:])})])
    first = next(i for i in range(len(tail)) if tail[i : i + 3] == b"\x0e\x00D")
    (tmp_path / "x.ulg").write_bytes(head + tail[first:])
    (tmp_path / "map.toml").write_text('[[channel]]\nname = "state/q"\ncolumn = "one.a"\nunit = "rad/s"\n')
    with pytest.raises(DataError, match="clock of channel 'state/q': time runs backward at sample 200"):
        read_log(tmp_path / "x.ulg", tmp_path / "map.toml", resample_hz=25.0)


@pytest.mark.parametrize(
    ("suffix", "library"), [("ulg", "pyulog"), ("bin", "pymavlink"), ("parquet", "pyarrow")]
)
def test_a_missing_extra_names_the_command_that_installs_it(tmp_path, monkeypatch, suffix, library):
    path = tmp_path / f"x.{suffix}"
    path.write_bytes(b"x")
    for name in [n for n in sys.modules if n.partition(".")[0] == library]:
        monkeypatch.setitem(sys.modules, name, None)
    monkeypatch.setitem(sys.modules, library, None)
    extra = "parquet" if suffix == "parquet" else "logs"
    with pytest.raises(DataError, match=rf"needs {library}, .* pip install 'freqid\[{extra}\]'"):
        read_log(path, "px4-multirotor")


def us(t):
    return np.rint(1e6 * t).astype(int).tolist()


def rows(t, *columns):
    return list(zip(us(t), *(np.asarray(c).tolist() for c in columns), strict=True))


def arducopter_messages(vehicle=1.0, *, start=5.0):
    fast, mid, slow = at(50, start), at(25, start + 0.003), at(10, start + 0.007)
    imu = []
    for instance in (0, 1):
        imu += rows(
            fast, np.full(fast.size, instance), *(0.1 * np.sin(fast + i) + instance for i in range(6))
        )
    roll, pitch, yaw = np.rad2deg(angles(mid))
    chirp = fast[(fast > start + 5) & (fast < start + 12)]
    again = fast[(fast > start + 18) & (fast < start + 22)]
    both = np.concatenate([chirp, again])
    pwm = 1500 + 100 * np.sin(fast)
    ekf = [(n, *velocity) for n, velocity in zip(us(mid), ground(mid).T.tolist(), strict=True)]
    return [
        ("PARM", "QNf", "TimeUS,Name,Value", [(us(fast[:1])[0], "SYSID_THISMAV", vehicle)]),
        ("MSG", "QZ", "TimeUS,Message", [(us(fast[:1])[0], "ArduCopter V4.5.1 (abc)")]),
        ("IMU", "QBffffff", "TimeUS,I,GyrX,GyrY,GyrZ,AccX,AccY,AccZ", imu),
        (
            "ATT",
            "Qccc",
            "TimeUS,Roll,Pitch,Yaw",
            rows(mid, *(np.rint(100 * a).astype(int) for a in (roll, pitch, yaw))),
        ),
        ("XKF1", "QBfff", "TimeUS,C,VN,VE,VD", [(n, 0, *v) for n, *v in ekf]),
        (
            "BAT",
            "QBff",
            "TimeUS,Inst,Volt,Curr",
            rows(slow, np.zeros(slow.size, int), 16 - 0.05 * slow, 0 * slow),
        ),
        ("RCOU", "QHHHH", "TimeUS,C1,C2,C3,C4", rows(fast, *(np.rint(pwm).astype(int) for _ in range(4)))),
        ("SIDS", "QBf", "TimeUS,Ax,Mag", [(us(chirp[:1])[0], 11, 0.2), (us(again[:1])[0], 10, 0.1)]),
        ("SIDD", "Qfff", "TimeUS,Time,Targ,F", rows(both, both, np.sin(4 * both), both)),
    ]


def test_an_ardupilot_log_and_its_chirps(tmp_path):
    path = tmp_path / "x.bin"
    path.write_bytes(dataflash_bytes(arducopter_messages()))
    record = read_log(path, "ardupilot-multirotor", resample_hz=50.0)
    t = record.time
    inside = (t > 8) & (t < 31)
    np.testing.assert_allclose(record["state/q"][inside], 0.1 * np.sin(t + 1)[inside], atol=1e-5)
    found = record.matrix(["state/phi", "state/theta", "state/psi"])
    np.testing.assert_allclose(found[:, inside], angles(t)[:, inside], atol=2e-4)  # logged to 0.01 deg
    still = np.array([record[f"state/{n}"] for n in "uvw"])
    turn = Rotation.from_euler("ZYX", angles(t)[::-1].T)
    np.testing.assert_allclose(still[:, inside], turn.inv().apply(ground(t).T).T[:, inside], atol=0.01)
    assert "still air assumed" in record.channel("state/u").source
    injected = record["excitation/mixer_pitch"]
    during = (t > 10.3) & (t < 16.7)
    np.testing.assert_allclose(injected[during], np.sin(4 * t)[during], atol=0.05)
    assert np.abs(injected[(t < 9.5) | (t > 17.5)]).max() < 0.01
    assert np.abs(record["excitation/mixer_roll"][(t > 23.3) & (t < 26.7)]).max() > 0.9
    assert record.provenance["chirps"] == {"mixer_roll": 1, "mixer_pitch": 1}
    assert record.channel("effector/n1").unit == "1"
    assert "command RCOU.C1 times BAT.Volt" in record.channel("effector/n1").source
    assert record.configuration.firmware.startswith("ArduCopter V4.5.1")
    assert "excitation/rate_roll" in record.provenance["not_logged"]


def test_parameters_without_names_are_none(tmp_path):
    """As damage to the format of the message leaves them."""
    path = tmp_path / "x.bin"
    whole = dataflash_bytes(arducopter_messages())
    assert whole.count(b"TimeUS,Name,Value") == 1
    path.write_bytes(whole.replace(b"TimeUS,Name,Value", b"TimeUS,Nome,Value"))
    record = read_log(path, "ardupilot-multirotor", resample_hz=50.0)
    assert record.configuration.parameter_hash == ""
    assert record.time.size > 100


def test_faults_of_a_dataflash_log(tmp_path):
    whole = dataflash_bytes(arducopter_messages())
    path = tmp_path / "x.bin"
    for content, said in (
        (
            whole + dataflash_bytes(arducopter_messages(2.0)),
            "two vehicles are mixed: SYSID_THISMAV is 1 and 2",
        ),
        (whole + whole, "two logs are joined"),
        (b"nothing", "is no DataFlash log"),
    ):
        path.write_bytes(content)
        with pytest.raises(DataError, match=said) as caught:
            read_log(path, "ardupilot-multirotor", resample_hz=50.0)
        assert caught.value.where == str(path)
    path.write_bytes(whole[:-11])  # logs end where the power was cut
    assert read_log(path, "ardupilot-multirotor", resample_hz=50.0).time[-1] > 34


def test_shipped_maps_are_valid_and_found_by_name(tmp_path):
    names = {path.stem for path in SHIPPED.glob("*.toml")}
    kinds = ("fixed-wing", "quadplane", "tiltwing", "multirotor")
    assert names == {f"{autopilot}-{kind}" for autopilot in ("px4", "ardupilot") for kind in kinds}
    for name in names:
        assert read_column_map(name).rotor
    with pytest.raises(
        DataError, match="neither a file nor a map that comes with freqid; did you mean 'px4-"
    ):
        find_map("px4-multicopter")
