"""Slower columns of a table leave cells blank: what is derived from them is as if they were whole."""

from __future__ import annotations

import numpy as np
import pytest

from freqid.workflows.import_log import read_log

TIME = np.arange(0, 60, 0.02)
PSI = 0.3 * np.sin(0.4 * TIME)
COLUMNS = {
    "t": TIME,
    "vn": 20 + 0 * TIME,
    "ve": 0 * TIME,
    "vd": 0 * TIME,
    "phi": 0 * TIME,
    "theta": 0 * TIME,
    "psi": PSI,
    "qw": np.cos(PSI / 2),
    "qx": 0 * TIME,
    "qy": 0 * TIME,
    "qz": np.sin(PSI / 2),
    "wn": 2 + np.sin(0.02 * TIME),
    "we": 0 * TIME,
    "cmd": 0.5 + 0.1 * np.sin(0.5 * TIME),
    "mass": 10 + 0 * TIME,
}
HEAD = '[time]\ncolumn = "t"\nunit = "s"\n'
NED = '[velocity]\nned = ["vn", "ve", "vd"]\n'
BY_ANGLES = NED + 'attitude = ["phi", "theta", "psi"]\nattitude_unit = "rad"\n'
BY_QUATERNION = '[attitude]\nquaternion = ["qw", "qx", "qy", "qz"]\n' + NED


def imported(tmp_path, text, every, changed=None):
    """Return a record of columns of which some are logged in every n-th row alone."""
    columns = {**COLUMNS, **(changed or {})}
    rows = [",".join(columns)]
    for i in range(TIME.size):
        told = {n: x[i] for n, x in columns.items() if i % every.get(n, 1) == 0}
        rows.append(",".join(f"{told[n]:.9g}" if n in told else "" for n in columns))
    (tmp_path / "log.csv").write_text("\n".join(rows) + "\n")
    (tmp_path / "map.toml").write_text(HEAD + text)
    return read_log(tmp_path / "log.csv", tmp_path / "map.toml", resample_hz=50, plausibility="off")


def test_a_command_in_every_fifth_row_is_no_motor_that_stands(tmp_path):
    rotor = '[[rotor]]\nname = "n1"\ncommand = "cmd"\nfull_speed_rpm = 6000\nfull_voltage = 10\n'
    found = imported(tmp_path, rotor, {"cmd": 5})
    expected = 200 * np.pi * (0.5 + 0.1 * np.sin(0.5 * found.time))
    np.testing.assert_allclose(found["effector/n1"], expected, rtol=0.01)


@pytest.mark.parametrize("every", [{"phi": 2, "theta": 2, "psi": 2}, {"psi": 5}])
def test_attitudes_with_blank_cells_turn_velocities_to_the_end(tmp_path, every):
    found = imported(tmp_path, BY_ANGLES, every)
    assert found.duration > 59
    np.testing.assert_allclose(found["state/u"], 20 * np.cos(0.3 * np.sin(0.4 * found.time)), atol=0.02)


def test_a_quaternion_whose_sign_changes_is_one_attitude_between_blank_cells_too(tmp_path):
    sign = np.where(TIME < 30, 1.0, -1.0)
    turned = {n: sign * COLUMNS[n] for n in ("qw", "qx", "qy", "qz")}
    found = imported(tmp_path, BY_QUATERNION, dict.fromkeys(turned, 2), turned)
    np.testing.assert_allclose(found["state/u"], 20 * np.cos(0.3 * np.sin(0.4 * found.time)), atol=0.02)


def test_a_wind_that_is_logged_once_a_second_leaves_velocities_as_fast_as_they_are(tmp_path):
    found = imported(tmp_path, BY_ANGLES + 'wind = ["wn", "we"]\n', {"wn": 50, "we": 50})
    assert found.channels["state/u"].native_rate_hz == pytest.approx(50, rel=0.01)


def test_a_mass_in_every_tenth_row_is_its_mean(tmp_path):
    masses = "".join(
        f'[[mass_property]]\nname = "{n}"\ncolumn = "mass"\nunit = "{unit}"\n'
        for n, unit in (("mass", "kg"), ("Ixx", "kg m2"), ("Iyy", "kg m2"), ("Izz", "kg m2"))
    )
    found = imported(tmp_path, BY_ANGLES + masses, {"mass": 10})
    assert found.mass_properties.mass_kg == pytest.approx(10.0)


def test_gps_weeks_are_those_of_a_channels_own_clock_too(tmp_path):
    text = '[[channel]]\nname = "state/q"\ncolumn = "q"\nunit = "rad/s"\ntime = "tq"\n'
    text += '[[channel]]\nname = "state/p"\ncolumn = "q"\nunit = "rad/s"\n'
    rows = {"t": TIME, "week": 2300 + 0 * TIME, "tq": TIME + 0.003, "q": np.sin(TIME)}
    lines = [",".join(rows), *(",".join(f"{x[i]:.9g}" for x in rows.values()) for i in range(TIME.size))]
    (tmp_path / "log.csv").write_text("\n".join(lines) + "\n")
    (tmp_path / "map.toml").write_text('[time]\ncolumn = "t"\nunit = "s"\nweek = "week"\n' + text)
    found = read_log(tmp_path / "log.csv", tmp_path / "map.toml", resample_hz=50, plausibility="off")
    p, middle = found["state/p"], slice(100, -100)
    late = p - 0.003 * np.gradient(p, found.time)  # q is what p was 3 ms before
    np.testing.assert_allclose(found["state/q"][middle], late[middle], atol=1e-3)
