"""Effects of the user's own: the example of the docs, and files that cannot be used."""

import re
from pathlib import Path

import numpy as np
import pytest

from freqid.core.errors import UsageError
from freqid.core.record import Channel, FlightRecord
from freqid.simulate import effects
from freqid.simulate.effects.files import load_file
from freqid.simulate.effects.table import KINDS, kinds, renewed
from freqid.workflows.fly import effect_settings

PROJECT = Path(__file__).resolve().parents[4]
EXAMPLE = PROJECT / "examples" / "gyro_effect.py"
HEAD = "from freqid.simulate.effects.effect import Effect, Parameter\nP = {'a': Parameter(0.0, '1', 'x')}\n"


@pytest.fixture
def own(monkeypatch):
    """A library that forgets what a test registers."""
    monkeypatch.setattr(effects, "_added", {})


def test_the_example_of_the_docs_is_the_file_that_it_names():
    page = (PROJECT / "docs" / "effects.md").read_text()
    assert EXAMPLE.read_text() in re.findall(r"^```python\n(.*?)^```", page, re.M | re.S)


def test_an_effect_of_ones_own_is_set_and_distorts_a_record_like_any_other(own):
    found = effect_settings(("gyro_acceleration=0.01", "mass.fraction=0.1"), EXAMPLE)
    assert found == {"gyro_acceleration": {"per_g": 0.01}, "mass": {"fraction": 0.1}}
    time = 0.02 * np.arange(50)
    rows = {"state/q": ("rad/s", 0.1 * np.sin(time)), "state/az": ("m/s2", -9.80665 + time)}
    record = FlightRecord(time, {n: Channel(n, u, v, 50.0, "made") for n, (u, v) in rows.items()})
    read = effects.distorted(record, effects.settings(found))
    np.testing.assert_allclose(read["state/q"] - record["state/q"], 0.01 * (-1 + time / 9.80665), atol=1e-15)
    assert effects.distorted(record, effects.settings({})) is record


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("x = 1\n", "holds no effect.*EFFECTS"),
        ("x = 1\nraise ValueError('no wind')\n", "raises ValueError: no wind, line 2"),
        ("def (\n", "raises SyntaxError"),
        ("EFFECT = 3\n", "found an effect of type int"),
        (
            HEAD + "EFFECT = Effect('mass', 'mass', 'M.', P, load=lambda s, v: v)\n",
            "'mass' has the id of one",
        ),
        (
            HEAD + "EFFECT = Effect('ice', 'wing', 'M.', P, load=lambda s, v: v)\n",
            "the stage 'wing', expected",
        ),
        (HEAD + "EFFECT = Effect('ice', 'mass', 'M.', {}, load=lambda s, v: v)\n", "has no parameters"),
        (HEAD + "EFFECT = Effect('ice', 'mass', 'M.', P)\n", "does nothing, expected one of the hooks"),
        (
            HEAD + "EFFECT = Effect('ice', 'mass', 'M.', P, load=lambda v: v)\n",
            r"called as load\(settings, veh",
        ),
        (
            HEAD + "EFFECT = Effect('ice', 'sensor', 'M.', P, distort=3)\n",
            r"called as distort\(settings, rec",
        ),
        (HEAD + "EFFECTS = 2 * [Effect('ice', 'mass', 'M.', P, load=lambda s, v: v)]\n", "is there twice"),
        (HEAD + "EFFECT = Effect('ice cap', 'mass', 'M.', P, load=lambda s, v: v)\n", "no Python name"),
    ],
)
def test_a_file_that_cannot_be_used_is_refused_in_words(tmp_path, text, said):
    path = tmp_path / "mine.py"
    path.write_text(text)
    with pytest.raises(UsageError, match=said) as raised:
        load_file(path)
    assert str(path) in str(raised.value)


def test_a_missing_file_is_refused_and_a_taken_id_cannot_be_registered(tmp_path, own):
    with pytest.raises(UsageError, match="cannot be read"):
        load_file(tmp_path / "none.py")
    with pytest.raises(UsageError, match="comes with freqid"):
        effects.register(effects.find("mass"))


def test_the_table_in_the_docs_is_current_and_lists_every_effect():
    page = (PROJECT / "docs" / "effects.md").read_text()
    assert renewed(page) == page, "run: python -m freqid.simulate.effects.table docs/effects.md"
    assert all(f"| `{identifier}` |" in page for identifier in effects.shipped())
    untestable = {i for i, e in effects.shipped().items() if kinds(e) != KINDS}
    assert untestable == {"turbulence"}
