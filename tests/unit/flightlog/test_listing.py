"""The map that a log is listed with."""

import tomllib

from freqid.flightlog.listing import list_log


def test_a_table_with_an_autopilots_names_and_one_clock_is_no_autopilots_log(tmp_path):
    """The shipped map has no clock and no column for what the table has besides."""
    path = tmp_path / "flight.csv"
    rows = [f"{20 * k},{0.1 * k},{0.2 * k},{k % 5}" for k in range(50)]
    path.write_text("\n".join(["TimeMS,IMU.GyrX,ATT.Roll,SRV.ail_deg", *rows]))
    proposed = tomllib.loads(list_log(path, ("ail",)).map)
    assert proposed["time"] == {"column": "TimeMS", "unit": "ms"}
    assert {c["name"]: c["column"] for c in proposed["channel"]} == {
        "state/p": "IMU.GyrX",
        "state/phi": "ATT.Roll",
        "effector/ail": "SRV.ail_deg",
    }
