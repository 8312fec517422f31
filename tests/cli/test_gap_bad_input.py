"""What ``diagnose-gap`` and ``check-simulation`` say of simulations and records that they cannot use.

One sentence that says where, what was found and what to do; exit code 3, or 2 for words; no file left behind.
"""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from freqid.cli.main import run
from freqid.core.record import read_record, write_record

MODELS = """
import numpy as np
from linear_simulation import wrench

def good(time, state, effector, air, parameters):
    return wrench(time, state, effector, air, parameters)

def nan(time, state, effector, air, parameters):
    return {"M": np.where(time - time[0] > 3, np.nan, state["q"])}

def infinite(time, state, effector, air, parameters):
    return {"M": np.exp(1e3 * (time - time[0]))}

def short(time, state, effector, air, parameters):
    return {"M": state["q"][:-1]}

def square(time, state, effector, air, parameters):
    return {"M": np.stack([state["q"], state["q"]])}

def constant(time, state, effector, air, parameters):
    return {"M": 0.0}

def half_constant(time, state, effector, air, parameters):
    return {"M": 0.0 * time, "L": 45.0 * effector["da"]}

def array(time, state, effector, air, parameters):
    return -18.0 * state["q"]

def nothing(time, state, effector, air, parameters):
    return None

def empty(time, state, effector, air, parameters):
    return {}

def words(time, state, effector, air, parameters):
    return {"M": "large"}

def complex_numbers(time, state, effector, air, parameters):
    return {"M": state["q"] + 1j * state["q"]}

def unknown(time, state, effector, air, parameters):
    return {"pitching_moment": -18.0 * state["q"]}

def raising(time, state, effector, air, parameters):
    raise RuntimeError("no licence")

def lacking(time, state, effector, air, parameters):
    return {"M": state["theta_dot"]}

def leaving(time, state, effector, air, parameters):
    raise SystemExit(7)

def few_arguments(time, state):
    return {"M": state["q"]}

def variant(**hooks):
    def model(time, state, effector, air, parameters):
        return wrench(time, state, effector, air, parameters)

    model.responses = wrench.responses
    for name, hook in hooks.items():
        setattr(model, name, hook)
    return model

def raised(record, parameters):
    raise OverflowError("the integrator gave up")

fly_diverging = variant(fly=lambda r, p: {"q": 1e-3 * np.exp(r.time - r.time[0])})
fly_nan = variant(fly=lambda r, p: {"q": np.where(r.time - r.time[0] > 3, np.nan, r["state/q"])})
fly_short = variant(fly=lambda r, p: {"q": r["state/q"][:-1]})
fly_still = variant(fly=lambda r, p: {"q": 0.0})
fly_raising = variant(fly=raised)
fly_array = variant(fly=lambda r, p: r["state/q"])
fly_number = variant(fly=3.0)
positions_short = variant(positions=lambda time, command, p: {n: x[:-1] for n, x in command.items()})
positions_nan = variant(positions=lambda time, command, p: {n: np.nan * x for n, x in command.items()})
positions_raising = variant(positions=lambda time, command, p: 1 / 0)
sigma_negative = variant(tolerances={"lift_slope": (-0.1, "1")})
sigma_nan = variant(tolerances={"lift_slope": (float("nan"), "1")})
sigma_words = variant(tolerances={"lift_slope": ("5 %", "1")})
sigma_alone = variant(tolerances={"lift_slope": 0.1})
sigma_huge = variant(tolerances={"lift_slope": (1e12, "1")})
responses_words = variant(responses="M")
effects_words = variant(effects="extra_drag")
not_a_function = 3.0
"""


@pytest.fixture(scope="module")
def folder(fly_worn, tmp_path_factory):
    there = tmp_path_factory.mktemp("bad")
    fly_worn(there, 0.5, (1,), period=20.0)
    (there / "models.py").write_text(MODELS)
    (there / "broken.py").write_text("def model(:\n")
    record = read_record(there / "flight1.h5")
    # effectors follow their commands at once here, so that commands can be sent through `positions`
    sent = [replace(record.channel(f"effector/{n}"), name=f"command/{n}") for n in record.group("effector")]
    write_record(there / "flight1.h5", record.with_channels(*sent))
    return there


@pytest.fixture(params=["diagnose-gap", "check-simulation"])
def ask(request, freqid, folder):
    """Run a command on a model; return exit code, stderr and the files that it left behind."""

    def call(model, *words, command=request.param, record="flight1.h5", file="models.py"):
        before = set(folder.iterdir())
        more = ["--no-page"] if command == "diagnose-gap" else []
        sim = ["--sim", f"{folder}/{file}:{model}"]
        code, _, err = freqid(command, folder / record, *sim, *more, *words)
        left = [
            p.name for p in set(folder.iterdir()) - before if p.suffix != ".pyc" and p.name != "__pycache__"
        ]
        return code, err, left

    return call


def assert_one_sentence(err, model):
    assert err.count("\n") == 1
    assert err.count(f":{model}") <= 1  # the place is said once
    assert not re.search(r"[^.]\.\.$", err)


@pytest.mark.parametrize(
    ("model", "code", "sentence"),
    [
        ("nan", 3, "models.py:nan: what the simulation returned as 'M' is not finite in"),
        ("infinite", 3, "is not finite in"),
        ("short", 3, "'M' has shape (1000,), expected (1001,)"),
        ("square", 3, "'M' has shape (2, 1001), expected (1001,)"),
        ("constant", 3, "returned the constant 0 as 'M'"),
        ("half_constant", 3, "returned the constant 0 as 'M'"),
        ("array", 3, "returned ndarray, expected a dictionary"),
        ("nothing", 3, "returned NoneType, expected a dictionary"),
        ("empty", 3, "returned no response"),
        ("words", 3, "as 'M' is no array of numbers but str"),
        ("complex_numbers", 3, "as 'M' is complex, expected real numbers"),
        ("unknown", 3, "'pitching_moment', which is no response"),
        ("raising", 3, "raised RuntimeError: no licence (line"),
        ("lacking", 3, "raised KeyError: 'theta_dot' (line"),
        ("leaving", 3, "raised SystemExit: 7 (line"),
        ("few_arguments", 3, "raised TypeError"),
        ("positions_short", 3, "models.py:positions_short.positions: what the simulation returned as"),
        ("positions_nan", 3, "is not finite in"),
        ("positions_raising", 3, "raised ZeroDivisionError: division by zero (line"),
        ("sigma_negative", 3, "tolerances['lift_slope']: a tolerance has sigma -0.1, expected"),
        ("sigma_nan", 3, "has sigma nan, expected"),
        ("sigma_words", 3, "has sigma '5 %', expected"),
        ("sigma_alone", 3, "tolerance 'lift_slope' is 0.1, expected a pair"),
        ("sigma_huge", 3, "tolerance 'lift_slope' has sigma 1e+12, expected at most 1000"),
        ("responses_words", 3, "responses is 'M', expected a tuple of names"),
        ("effects_words", 3, "effects is 'extra_drag', expected settings by effect"),
        ("not_a_function", 2, "it defines no function 'not_a_function'"),
    ],
)
def test_a_simulation_that_cannot_be_used_is_one_sentence(ask, model, code, sentence):
    got, err, left = ask(model)
    assert (got, sentence in err) == (code, True), err
    assert_one_sentence(err, model)
    assert left == []


def test_a_file_that_is_no_python_is_one_sentence(ask):
    code, err, left = ask("model", file="broken.py")
    assert (code, left) == (3, [])
    assert "broken.py: the file cannot be run: SyntaxError" in err
    assert err.count("\n") == 1


@pytest.mark.parametrize(
    ("model", "sentence"),
    [
        ("fly_diverging", "own flight diverges: q is"),
        ("fly_nan", "models.py:fly_nan.fly: what the simulation returned as 'q' is not finite in"),
        ("fly_short", "'q' has shape (1000,), expected (1001,)"),
        ("fly_still", "own flight stands still from t = 0 s on"),
        ("fly_raising", "raised OverflowError: the integrator gave up (line"),
        ("fly_array", "returned ndarray, expected a dictionary"),
        ("fly_number", "fly is float, expected a function"),
    ],
)
def test_a_flight_that_cannot_be_used_is_one_sentence(ask, model, sentence):
    code, err, left = ask(model)
    assert (code, sentence in err) == (3, True), err
    assert_one_sentence(err, model)
    assert left == []


@pytest.fixture(scope="module")
def records(folder, linear_aircraft):
    """Records that lack something, beside the flight that they are made from."""
    good = read_record(folder / "flight1.h5")

    def write(name, values=None, without=()):
        channels = {n: c for n, c in good.channels.items() if n not in without}
        changed = (
            {n: replace(c, values=values(n, c.values)) for n, c in channels.items()} if values else channels
        )
        write_record(folder / f"{name}.h5", replace(good, channels=changed))

    def still(*heads):
        return lambda n, x: np.full_like(x, x[0]) if n.startswith(heads) else x

    write("no_az", without=("state/az",))
    write("no_elevator", without=("effector/de", "command/de"))
    write("still_states", still("state/"))
    write("still_elevator", still("effector/de"))
    smooth = linear_aircraft.fly(seed=1, noise=0.0, period=20.0, periods=1)
    smooth.to_csv(folder / "smooth.csv", index=False, float_format="%.10g")
    words = f"import-log {folder}/smooth.csv --scenario scenarios/linear.toml --at u20 "
    words += f"--map scenarios/maps/linear.toml -o {folder}/smooth.h5"
    with pytest.raises(SystemExit) as left:
        run(words.split())
    assert left.value.code == 0


@pytest.mark.usefixtures("records")
@pytest.mark.parametrize(
    ("record", "sentence"),
    [
        ("no_az", "no_az.h5: channel 'state/az' is missing"),
        ("no_elevator", "raised KeyError: 'de' (line"),
        ("still_states", "still_states.h5: none of its states moves"),
        (
            "still_elevator",
            "still_elevator.h5: effector/de stands still while the signal injected",
        ),
        ("absent", "absent.h5: no such file"),
    ],
)
def test_a_record_that_cannot_be_used_is_one_sentence(ask, record, sentence):
    code, err, left = ask("good", record=f"{record}.h5")
    assert (code, sentence in err) == (3, True), err
    assert_one_sentence(err, "good")
    assert left == []


@pytest.mark.usefixtures("records")
@pytest.mark.parametrize("ask", ["diagnose-gap"], indirect=True)
def test_a_record_without_noise_is_one_sentence(ask):
    """What counts as a gap cannot be told from it; mistakes of bookkeeping can."""
    code, err, left = ask("good", record="smooth.h5")
    assert (code, "smooth.h5: its samples show no noise" in err) == (3, True), err
    assert_one_sentence(err, "good")
    assert left == []
    assert ask("good", command="check-simulation", record="smooth.h5")[0] == 0


@pytest.mark.parametrize("ask", ["diagnose-gap"], indirect=True)
@pytest.mark.parametrize(
    ("words", "code", "sentence"),
    [
        (("--tolerance", "mass=much"), 2, "--tolerance is NAME=SIGMA such as mass=0.01, not 'mass=much'"),
        (("--tolerance", "mass=-0.1"), 3, "mass is -0.1, expected one sigma"),
        (("--tolerance", "mass=nan"), 3, "mass is nan, expected one sigma"),
        (("--tolerance", "mass=inf"), 3, "mass is inf, expected one sigma"),
        (
            ("--tolerance", "sensor_bias.u=5000"),
            3,
            "sensor_bias.u is 5000.0, expected one sigma from 0",
        ),
    ],
)
def test_absurd_tolerances_are_one_sentence(ask, words, code, sentence):
    got, err, left = ask("good", *words)
    assert (got, sentence in err) == (code, True), err
    assert_one_sentence(err, "good")
    assert left == []
