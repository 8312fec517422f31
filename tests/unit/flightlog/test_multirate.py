"""Logs with several clocks, gaps and spikes: what becomes one record, and what is said about it."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from freqid.core.errors import DataError, UsageError
from freqid.flightlog.column_map import (
    AttitudePlace,
    ChannelPlace,
    ColumnMap,
    RotorPlace,
    TimePlace,
    VelocityPlace,
)
from freqid.flightlog.read import read_log
from freqid.flightlog.spikes import find_spikes

TWO_CLOCKS = ColumnMap(
    time=TimePlace(column="t_ms", unit="ms"),
    channel=(
        ChannelPlace(name="state/q", column="q", unit="rad/s"),
        ChannelPlace(name="effector/n1", column="rpm", unit="rpm", time="t_esc_ms"),
    ),
)


def two_clocks(path):
    """q at 100 Hz; a speed at 20 Hz on its own clock, in the first rows of the same table."""
    t = np.arange(0, 20, 0.01)
    slow = 0.003 + np.arange(0, 19.9, 0.05)
    table = pd.DataFrame({"t_ms": 1000 * t, "q": np.sin(t)})
    table["t_esc_ms"] = pd.Series(1000 * slow)
    table["rpm"] = pd.Series(3000 + 500 * np.sin(slow))
    table.to_csv(path, index=False)


def test_a_channel_may_have_its_own_clock_in_a_table(tmp_path):
    two_clocks(tmp_path / "x.csv")
    with pytest.raises(
        DataError, match=r"'state/q' at 100 Hz, 'effector/n1' at 20 Hz; put them on one with --resample"
    ):
        read_log(tmp_path / "x.csv", TWO_CLOCKS)
    record = read_log(tmp_path / "x.csv", TWO_CLOCKS, resample_hz=50.0)
    rpm = record["effector/n1"] * 30 / np.pi
    inside = (record.time > 2) & (record.time < 17)
    np.testing.assert_allclose(rpm[inside], (3000 + 500 * np.sin(record.time))[inside], atol=0.2)
    assert record.channel("effector/n1").native_rate_hz == pytest.approx(20)
    assert record.provenance["resampled"]["jitter_s"]["state/q"] == pytest.approx(0, abs=1e-9)


def test_the_provenance_names_dropouts_and_whole_stretches(tmp_path):
    t = np.arange(0, 20, 0.01)
    q = np.sin(t)
    q[(t > 7.995) & (t < 8.295)] = np.nan
    pd.DataFrame({"t": t, "q": q, "p": np.cos(t)}).to_csv(tmp_path / "x.csv", index=False)
    column_map = ColumnMap(
        time=TimePlace(column="t", unit="s"),
        channel=(
            ChannelPlace(name="state/p", column="p", unit="rad/s", optional=True),
            ChannelPlace(name="state/q", column="q", unit="rad/s"),
            ChannelPlace(name="state/r", column="r", otherwise=("yaw",), unit="rad/s", optional=True),
        ),
    )
    record = read_log(tmp_path / "x.csv", column_map, resample_hz=100.0)
    assert record.provenance["not_logged"] == ["state/r"]
    dropout = next(d for d in record.provenance["dropouts"] if d["channel"] == "state/q")
    assert (dropout["start_s"], dropout["stop_s"]) == (pytest.approx(7.99), pytest.approx(8.3))
    np.testing.assert_allclose(record.provenance["whole_spans_s"], [[0, 7.99], [8.3, 19.99]])
    assert record.time[0] == pytest.approx(8.3)
    whole = read_log(tmp_path / "x.csv", column_map, resample_hz=100.0, cut=(0.0, 7.99))
    assert whole.time[-1] == pytest.approx(7.99)
    assert "dropouts" not in whole.provenance


@pytest.mark.parametrize("suffix", ["csv", "parquet"])
def test_dates_and_epochs_become_seconds_of_the_log(tmp_path, suffix):
    path = tmp_path / f"x.{suffix}"
    seconds = np.arange(0, 4, 0.02)
    when = pd.Timestamp("2026-05-01T12:30:00") + pd.to_timedelta(seconds, unit="s")
    table = pd.DataFrame(
        {"when": when, "unix": 1777638600.0 + seconds, "tow": 604799 + seconds, "week": 2416}
    )
    table["q"] = seconds
    table.to_csv(path, index=False) if suffix == "csv" else table.to_parquet(path, index=False)
    q = (ChannelPlace(name="state/q", column="q", unit="rad/s"),)
    for place, start in (
        (TimePlace(column="when", unit="date"), "2026-05-01T12:30:00"),
        (TimePlace(column="unix", unit="s", epoch="unix"), "2026-05-01T12:30:00"),
        (TimePlace(column="tow", unit="s", week="week"), "2026-05-02T23:59:59"),
    ):
        record = read_log(path, ColumnMap(time=place, channel=q), cut=(1.0, 3.0))
        np.testing.assert_allclose(record.time, record["state/q"], atol=1e-6)
        assert record.time[0] == pytest.approx(1.0, abs=1e-6)
        assert record.provenance["clock_start"].startswith(start)


def test_spikes_are_left_out_counted_and_bridged(tmp_path):
    rng = np.random.default_rng(3)
    t = np.arange(0, 40, 0.01)
    clean = 2000 + 300 * np.sin(2 * np.pi * 2 * t) + rng.normal(size=t.size)
    x = clean.copy()
    at = rng.choice(np.arange(50, t.size - 50, 7), 40, replace=False)
    x[at] += rng.choice([-1, 1], at.size) * rng.uniform(300, 1e5, at.size)
    x[at[0] + 1] = x[at[0]]
    np.testing.assert_array_equal(np.flatnonzero(find_spikes(x)), np.sort([*at, at[0] + 1]))
    assert not find_spikes(clean).any()
    assert not find_spikes(np.where(t < 20, 0.0, 5.0)).any()  # a step is none
    pd.DataFrame({"t": t, "n": x}).to_csv(tmp_path / "x.csv", index=False)
    column_map = ColumnMap(
        time=TimePlace(column="t", unit="s"),
        channel=(ChannelPlace(name="effector/n1", column="n", unit="rad/s"),),
    )
    record = read_log(tmp_path / "x.csv", column_map, resample_hz=100.0, despike=True)
    assert record.provenance["spikes"] == {"effector/n1": 41}
    assert np.abs(record["effector/n1"] - clean)[200:-200].max() < 20
    with pytest.raises(UsageError, match="spikes are left out and bridged"):
        read_log(tmp_path / "x.csv", column_map, despike=True)


def test_attitude_velocity_and_rotors_are_derived(tmp_path):
    """Against scipy's rotations, and a rotor's speed by hand."""
    from scipy.spatial.transform import Rotation

    t = np.arange(0, 10, 0.02)
    angles = np.array([0.3 * np.sin(t), 0.2 * np.cos(t), 2.5 + 0.2 * t])
    turn = Rotation.from_euler("ZYX", angles[::-1].T)
    x, y, z, w = turn.as_quat().T
    sign = np.where(np.arange(t.size) % 2, -1, 1)
    air = np.array([20 + np.sin(t), 0.5 * t, 1 + 0 * t])
    ned = turn.apply(air.T).T + np.array([3.0, -2.0, 0.0])[:, None]
    table = pd.DataFrame(dict(zip(("t", "w", "x", "y", "z"), (t, *(sign * [w, x, y, z])), strict=True)))
    for name, row in zip(("vn", "ve", "vd"), ned, strict=True):
        table[name] = row
    table["wn"], table["we"], table["esc"], table["volt"] = 3.0, -2.0, 0.0, 15 - 0.1 * t
    table["pwm"] = 1500 + 100 * np.sin(t)
    table.to_csv(tmp_path / "x.csv", index=False)
    rotor = {"telemetry": "esc", "command": "pwm", "off": 1000, "full": 2000, "voltage": "volt"}
    column_map = ColumnMap(
        time=TimePlace(column="t", unit="s"),
        attitude=AttitudePlace(quaternion=("w", "x", "y", "z")),
        velocity=VelocityPlace(ned=("vn", "ve", "vd"), wind=("wn", "we")),
        rotor=(
            RotorPlace(name="n1", **rotor),
            RotorPlace(name="n2", **rotor, full_speed_rpm=9000, full_voltage=16),
            RotorPlace(name="n3", telemetry="none"),
        ),
    )
    record = read_log(tmp_path / "x.csv", column_map)
    found = record.matrix(["state/phi", "state/theta", "state/psi"])
    np.testing.assert_allclose(np.exp(1j * found), np.exp(1j * angles), atol=1e-9)
    np.testing.assert_allclose(record.matrix(["state/u", "state/v", "state/w"]), air, atol=1e-9)
    assert "less the logged wind" in record.channel("state/u").source
    command = (table["pwm"] - 1000) / 1000
    expected = command * table["volt"] / table["volt"].mean()
    np.testing.assert_allclose(record["effector/n1"], expected, rtol=1e-12)
    assert record.channel("effector/n1").unit == "1"
    np.testing.assert_allclose(record["effector/n2"], command * table["volt"] / 16 * 300 * np.pi, rtol=1e-12)
    assert "no ESC telemetry: command pwm times volt over 16 V" in record.channel("effector/n2").source
    assert "effector/n3" not in record
    table["esc"] = 4000.0
    table.to_csv(tmp_path / "x.csv", index=False)
    record = read_log(tmp_path / "x.csv", column_map)
    np.testing.assert_allclose(record["effector/n1"], 4000 * np.pi / 30)
    assert "ESC telemetry esc" in record.channel("effector/n1").source


TABLE = "".join(f"{0.01 * i:.2f},{i},{2 * i}\n" for i in range(50))


@pytest.mark.parametrize(
    "head",
    [
        "t,q,r\n",
        "time series of run 7\ndate: 2026-05-01, wind calm\n\nt,q,r\n",
        "t,q,r\ns,deg/s,deg/s\n",
        "# logger 3\n# t,q,r\n",
        "logger 3\nt,q,r\n(s),(deg/s),(deg/s)\n",
    ],
)
def test_preambles_and_rows_of_units_are_skipped(tmp_path, head):
    (tmp_path / "x.csv").write_text(head + TABLE)
    q = ChannelPlace(name="state/q", column="q", unit="deg/s")
    record = read_log(tmp_path / "x.csv", ColumnMap(time=TimePlace(column="t", unit="s"), channel=(q,)))
    np.testing.assert_allclose(np.rad2deg(record["state/q"]), np.arange(50))
