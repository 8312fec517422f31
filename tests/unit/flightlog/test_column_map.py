"""The column map: what it accepts, and what it says about the rest."""

from __future__ import annotations

import pytest

from freqid.core.errors import DataError, UsageError
from freqid.flightlog.column_map import read_column_map

GOOD = """
[time]
column = "t"
unit = "s"
[[channel]]
name = "state/u"
column = 3
unit = "ft/s"
sign = -1
position_m = [0.1, 0, -0.2]
rate_hz = 10
[[mass_property]]
name = "Ixx"
variable = "fds.Ixx"
unit = "slug ft2"
[record]
tail = "N1"
reference = "hover"
"""


def written(tmp_path, text):
    path = tmp_path / "map.toml"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


def test_a_map_is_read_whole(tmp_path):
    found = read_column_map(written(tmp_path, GOOD))
    assert (found.time.column, found.time.unit) == ("t", "s")
    (channel,) = found.channel
    assert (channel.name, channel.column, channel.unit, channel.sign) == ("state/u", 3, "ft/s", -1)
    assert channel.position_m == (0.1, 0.0, -0.2)
    assert channel.rate_hz == 10.0
    assert (found.mass_property[0].name, found.mass_property[0].variable) == ("Ixx", "fds.Ixx")
    assert (found.record.tail, found.record.reference, found.record.firmware) == ("N1", "hover", "")


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("sign = -1", "sgn = -1", r"channel\[.*\]: key 'sgn' is unknown; did you mean 'sign'"),
        ("sign = -1", "sign = 2", "sign"),
        ("column = 3", "column = 0", "counted from 1"),
        ("column = 3\n", "", "neither column nor variable"),
        ("rate_hz = 10", "rate_hz = 0", "positive rate"),
        ("position_m = [0.1, 0, -0.2]", "position_m = [0.1, nan, 0]", "finite"),
        ("position_m = [0.1, 0, -0.2]", "position_m = [0.1]", "length"),
        ('name = "Ixx"', 'name = "Ix"', "Ix"),
        ('tail = "N1"', "tail = 7", "tail"),
        ("[time]", "[tim]", "'tim' is unknown"),
        ('[[channel]]\nname = "state/u"', "[[channel]]\nname = 4", "name"),
    ],
)
def test_a_wrong_key_or_value_is_named_by_its_path(tmp_path, old, new, said):
    assert old in GOOD
    with pytest.raises(UsageError, match=said) as caught:
        read_column_map(written(tmp_path, GOOD.replace(old, new)))
    assert caught.value.where == str(tmp_path / "map.toml")


def test_a_channel_named_twice_is_refused(tmp_path):
    twice = GOOD + '[[channel]]\nname = "state/u"\ncolumn = 4\nunit = "m/s"\n'
    with pytest.raises(UsageError, match=r"\['state/u'\] more than once"):
        read_column_map(written(tmp_path, twice))


def test_a_map_without_channels_is_refused(tmp_path):
    with pytest.raises(UsageError, match="no channel"):
        read_column_map(written(tmp_path, 'channel = []\n[time]\ncolumn = 1\nunit = "s"\n'))


def test_an_unknown_channel_suggests_the_nearest(tmp_path):
    with pytest.raises(DataError, match="did you mean 'theta'") as caught:
        read_column_map(written(tmp_path, GOOD.replace("state/u", "state/thta")))
    assert caught.value.where == str(tmp_path / "map.toml")


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"[time]\ncolumn = \n", "line 2"),
        (b"[time]\n# stra\xdfe\ncolumn = 1\n", "line 2 is no UTF-8"),
        (b"a = " + b"[" * 5000, "no valid TOML"),
        (b"a = " + b"9" * 5000, "no valid TOML"),
    ],
)
def test_what_is_no_toml_is_a_data_error_with_its_line(tmp_path, content, said):
    with pytest.raises(DataError, match=said):
        read_column_map(written(tmp_path, content))


def test_a_missing_map_is_a_data_error(tmp_path):
    with pytest.raises(DataError, match="cannot be read"):
        read_column_map(tmp_path / "none.toml")
