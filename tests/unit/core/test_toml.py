import msgspec
import pytest

from freqid.core.errors import DataError, UsageError
from freqid.core.toml import convert, overridden, read_toml
from freqid.core.vehicle import Strict


class Gain(Strict, frozen=True):
    kp: float
    ki: float = 0.0

    def __post_init__(self):
        if self.kp < 0:
            raise ValueError("kp is negative")


class Loops(Strict, frozen=True):
    roll: Gain
    others: dict[str, Gain] = msgspec.field(default_factory=dict)


def test_a_file_is_read_with_the_digest_of_its_bytes(tmp_path):
    path = tmp_path / "loops.toml"
    path.write_bytes(b"roll = {kp = 2.0}\n")
    content, sha256 = read_toml(path, Loops)
    assert content == Loops(roll=Gain(kp=2.0))
    assert sha256 == "e4c863425463d44ce78e98344b89af58aa3e9ab684797c06f45cbc9049e857f6"


@pytest.mark.parametrize(
    ("table", "kind", "says"),
    [
        ({"roll": {"kP": 1.0}}, Loops, r"f\.toml: at roll: key 'kP' is unknown; did you mean 'kp'"),
        ({"roll": {"kp": 1.0}, "others": {"yaw": {"kI": 1.0}}}, Loops, r"key 'kI' is unknown; .*'ki'"),
        ({"yaw": {"kI": 1.0}}, dict[str, Gain], r"key 'kI' is unknown; did you mean 'ki'"),
        ({"yaw": {"kp": -1.0}}, dict[str, Gain], "kp is negative"),
        ({"yaw": 1.0}, dict[str, Gain], "expected `object`, got `float`"),
        ([{"kI": 1.0}], tuple[Gain, ...], r"at \[0\]: key 'kI' is unknown; did you mean 'ki'"),
        ({"yaw": 1.0}, dict[str, str], "expected `str`, got `float`"),
    ],
)
def test_a_slip_is_named_whatever_the_structs_are_nested_in(table, kind, says):
    with pytest.raises(UsageError, match=says):
        convert(table, kind, "f.toml")


def test_an_override_is_validated_like_the_file():
    assert overridden(Gain(kp=1.0, ki=2.0), kp=3.0, ki=None) == Gain(kp=3.0, ki=2.0)
    with pytest.raises(UsageError, match=r"command line: .*kp is negative"):
        overridden(Gain(kp=1.0), kp=-1.0)


@pytest.mark.parametrize(
    ("content", "says"),
    [(b"[roll\n", "no valid TOML .*line 1"), (b"a = 1\n# stra\xdfe\n", "line 2 is no UTF-8 text")],
)
def test_what_is_no_toml_is_a_data_error_with_its_line(tmp_path, content, says):
    (tmp_path / "loops.toml").write_bytes(content)
    with pytest.raises(DataError, match=says):
        read_toml(tmp_path / "loops.toml", Loops)
