"""``import-log`` with a log that nobody has described yet: listed, mapped by the listing, imported."""

from __future__ import annotations

import json
import tomllib

import numpy as np
import pandas as pd
import pytest

from freqid.core.record import read_record
from freqid.flightlog.names import recognise


def table(path):
    t = np.arange(0, 30, 0.02)
    x = pd.DataFrame(
        {"time_s": t, "bodyAngularRateWrtEi_deg_s_Pitch": np.sin(t), "elevator (deg)": np.cos(t)}
    )
    x["motor1_rpm"] = 5000 + 50 * np.sin(t)
    x["remark_count"] = np.arange(t.size) % 7
    x.loc[(t > 10) & (t < 10.3), "motor1_rpm"] = np.nan
    x.loc[800, "motor1_rpm"] = 1e6
    x.to_csv(path, index=False)


def test_a_listing_is_a_map_that_imports_the_log(freqid, tmp_path):
    table(tmp_path / "x.csv")
    code, out, err = freqid("import-log", tmp_path / "x.csv", "--list")
    assert (code, err) == (0, "")
    assert "motor1_rpm" in out
    assert "50 Hz" in out
    (tmp_path / "map.toml").write_text(out)
    arguments = ("import-log", tmp_path / "x.csv", "--map", tmp_path / "map.toml", "-o", tmp_path / "x.h5")
    code, out, err = freqid(*arguments, "--resample", 50, "--despike")
    assert code == 0
    assert "1 dropout, the longest 0.32 s of effector/n1 after 9.98 s" in err or "1 dropout" in err
    assert "the longest is kept, --split keeps all" in err
    assert "effector/n1: 1 spike left out" in out
    record = read_record(tmp_path / "x.h5")
    assert set(record.channels) == {"state/q", "effector/elevator", "effector/n1"}
    assert record.channel("effector/elevator").unit == "rad"
    assert record.time[0] == pytest.approx(10.3, abs=0.03)
    inside = (record.time > 12) & (record.time < 28)
    np.testing.assert_allclose(np.rad2deg(record["state/q"])[inside], np.sin(record.time)[inside], atol=1e-4)
    assert np.abs(record["effector/n1"] * 30 / np.pi - 5000).max() < 60
    code, out, _ = freqid("import-log", tmp_path / "x.csv", "--list", "--json")
    listed = {c["name"]: c for c in json.loads(out)["channels"]}
    assert len(listed["motor1_rpm"]["gaps_s"]) == 1


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("bodyAngularRateWrtEi_deg_s_Roll", ("state/p", "deg/s")),
        ("altitudeMsl_ft", ("state/alt", "ft")),
        ("eulerAngle_deg_Yaw", ("state/psi", "deg")),
        ("airDensity_slug_ft3", ("air/rho", "slug/ft3")),
        ("trueAirspeed_nmi_h", ("air/V", "nmi/h")),
        ("accel_ft_s2_X", ("state/ax", "ft/s2")),
        ("Q (deg/s)", ("state/q", "deg/s")),
        ("V_{Total} (ft/s)", ("air/V", "ft/s")),
        ("/fdm/jsbsim/velocities/r-rad_sec", ("state/r", "rad/s")),
        ("/fdm/jsbsim/aero/alpha-deg", ("air/alpha", "deg")),
        ("m3_erpm", ("effector/n3", "rpm")),
        ("nonsense_deg", ("", "deg")),
        ("INJ_RPM1", ("excitation/n1", "rpm")),
        ("cmd elevator (deg)", ("command/elevator", "deg")),
        ("INJ_nonsense", ("", "")),
        ("RHO_kgm3", ("air/rho", "kg/m3")),
    ],
)
def test_names_of_other_loggers(name, expected):
    assert recognise(name) == expected


def test_the_effectors_of_a_scenario_are_found_among_the_columns(freqid, tmp_path):
    names = "FLN_L (deg),CMD_FLN_L (deg),INJ_FLN_L (deg),Rot FL (rpm),inj_rot_fl"
    (tmp_path / "x.csv").write_text(f"time,{names}\n" + "".join(f"{i},1,2,3,4,5\n" for i in range(9)))
    freqid("new-scenario", "--effectors", "fln_l:surface,rot_fl:rotor", "-o", tmp_path / "s.toml")
    code, out, err = freqid("import-log", tmp_path / "x.csv", "--list", "--scenario", tmp_path / "s.toml")
    assert code == 0, err
    proposed = tomllib.loads(out)["channel"]
    assert [c["name"] for c in proposed] == [
        "effector/fln_l",
        "command/fln_l",
        "excitation/fln_l",
        "effector/rot_fl",
        "excitation/rot_fl",
    ]
