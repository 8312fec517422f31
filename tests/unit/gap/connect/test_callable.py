"""A user's function: what it is given, what it answers, and what is said when it goes wrong."""

import numpy as np
import pytest

from freqid.core.errors import DataError, UsageError
from freqid.core.record import Channel, FlightRecord
from freqid.core.vehicle import Inertia, MassProperties, Vehicle
from freqid.gap.connect import connect
from freqid.gap.simulation import Tolerance

GOOD = """
import numpy as np

def wrench(time, state, effector, air, parameters):
    gain = parameters.get("extra_drag", {}).get("coefficient", 0.0)
    return {
        "X": -(0.3 + gain + parameters.get("lift_slope", 0.0)) * air["V"] ** 2,
        "M": air["qbar"] * (2.0 * effector["de"] - 0.1 * state["q"]),
    }
wrench.effects = {"extra_drag": {"coefficient": 0.1}}
wrench.positions = lambda time, command, parameters: {"de": 0.5 * command["de"]}
wrench.fly = lambda record, parameters: {
    "q": 0.2 * record["command/de"],
    "state/theta": (1 + parameters.get("damping", 0.0)) * record["command/de"],
    "effector/de": 0.5 * record["command/de"],
    "command/de": record["command/de"],
}
wrench.tolerances = {"lift_slope": (0.3, "1/rad"), "damping": (0.05, "1")}
wrench.gyroscopic = False
"""


@pytest.fixture(scope="module")
def record():
    time = np.arange(101) / 50
    u, w = 20 + np.sin(time), np.cos(2 * time)
    signals = {
        "state/u": ("m/s", u),
        "state/v": ("m/s", 0 * time),
        "state/w": ("m/s", w),
        "state/q": ("rad/s", 0.1 * np.sin(3 * time)),
        "air/rho": ("kg/m3", np.full(time.size, 1.2)),
        "air/V": ("m/s", np.hypot(u, w)),
        "air/qbar": ("Pa", 0.6 * (u**2 + w**2)),
        "effector/de": ("rad", 0.05 * np.cos(5 * time)),
        "command/de": ("rad", 0.1 * np.cos(5 * time)),
    }
    return FlightRecord(time, {n: Channel(n, x, v, 50.0, "made") for n, (x, v) in signals.items()})


@pytest.fixture
def function(tmp_path, record):
    def write(text, name="wrench", **options):
        path = tmp_path / "model.py"
        path.write_text(text)
        return connect(f"{path}:{name}", record=record, **options)

    return write


def test_a_function_answers_on_the_records_channels(function, record):
    simulation = function(GOOD)
    assert simulation.responses == ("X", "M")
    x, m = simulation.predict(record)
    assert np.allclose(x, -0.4 * record["air/V"] ** 2)
    assert np.allclose(m, record["air/qbar"] * (2 * record["effector/de"] - 0.1 * record["state/q"]))
    assert np.allclose(
        simulation.predict(record, {"extra_drag": {"coefficient": 0.3}})[0], -0.6 * record["air/V"] ** 2
    )
    assert np.allclose(simulation.positions(record)["de"], 0.5 * record["command/de"])
    flown = simulation.fly(record)
    assert set(flown) == {"q", "theta", "effector/de", "command/de"}
    assert np.allclose(flown["theta"], record["command/de"])


def test_a_function_says_what_it_can_do(function, record):
    able, plain = function(GOOD), function(wrench("return {'X': time}"))
    assert (able.can_fly, able.has_actuators, able.gyroscopic) == (True, True, False)
    assert (plain.can_fly, plain.has_actuators, plain.gyroscopic) == (False, False, None)
    assert plain.tolerances == {}
    assert plain.fly(record) is None
    assert plain.positions(record) == {}


def test_departures_of_its_own_parameters_reach_the_function(function, record):
    simulation = function(GOOD)
    assert simulation.tolerances == {"lift_slope": Tolerance(0.3, "1/rad"), "damping": Tolerance(0.05, "1")}
    change = simulation.predict(record, departures={"lift_slope": 0.3}) - simulation.predict(record)
    assert np.allclose(change[0], -0.3 * record["air/V"] ** 2)
    both = simulation.predict(record, {"extra_drag": {"coefficient": 0.0}}, {"lift_slope": -0.1})
    assert np.allclose(both[0], -0.2 * record["air/V"] ** 2)
    assert np.allclose(simulation.fly(record, departures={"damping": 1.0})["theta"], 2 * record["command/de"])
    with pytest.raises(UsageError, match="no parameter 'lift_slop' of its own; did you mean 'lift_slope'"):
        simulation.predict(record, departures={"lift_slop": 0.3})


def test_derivatives_carry_the_air_data_that_follow_a_velocity(function, record):
    found = function(GOOD).gradient(record, ["state/u", "state/q", "effector/de"])
    moment = 2 * record["effector/de"] - 0.1 * record["state/q"]
    assert np.allclose(found[0, 0], -0.8 * record["state/u"], rtol=1e-3)
    assert np.allclose(found[1, 0], 1.2 * record["state/u"] * moment, atol=1e-3)
    assert np.allclose(found[1, 1], -0.1 * record["air/qbar"])
    assert np.allclose(found[1, 2], 2 * record["air/qbar"])


def test_air_data_that_were_not_logged_are_computed_at_the_centre_of_gravity(function, record):
    vehicle = Vehicle(
        name="made",
        mass_properties=MassProperties(mass_kg=1.0, inertia=Inertia(xx=1, yy=1, zz=1), cg_m=(0.2, 0.0, 0.0)),
    )
    channels = {n: c for n, c in record.channels.items() if n not in ("air/V", "air/qbar")}
    bare = FlightRecord(record.time, channels, vehicle)
    assert np.allclose(function(GOOD).predict(bare), function(GOOD).predict(record))


def wrench(body):
    return f"import numpy as np\ndef wrench(time, state, effector, air, parameters):\n    {body}\n"


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (wrench("return {'X': state['nothing']}"), "raised KeyError: 'nothing' (line 3 of model.py)"),
        (wrench("return {'X': np.where(time < 1, 0, np.nan)}"), "first at t = 1 s"),
        (wrench("return {'X': np.zeros(7)}"), "has shape (7,), expected (101,)"),
        (wrench("return {'XX': time}"), "'XX', which is no response and no state; did you mean 'X'"),
        (wrench("return time"), "returned ndarray, expected a dictionary"),
        (wrench("return {'X': 'much'}"), "is no array of numbers but str"),
        (wrench("return {}"), "returned no response"),
        (wrench("return {'X': time}") + "wrench.responses = ('X', 'Z')", "no 'Z', which it says it predicts"),
        (wrench("return {'X': time}") + "wrench.responses = ('Q',)", "'Q' among the responses"),
        (wrench("return {'X': 3.0}"), "returned the constant 3 as 'X', and nothing that moves"),
        (wrench("return {'X': time}") + "wrench.responses = (['X'],)", "'['X']' among the responses"),
        (wrench("return {'X': [1j * t for t in time]}"), "returned as 'X' is complex, expected real numbers"),
        (wrench("return {'X': time}") + "wrench.gyroscopic = 1", "gyroscopic is 1, expected True or False"),
        (
            wrench("return {'X': time}") + "wrench.vehicle = {'mass': 3}",
            "vehicle is dict, expected a Vehicle",
        ),
        (
            wrench("return {'X': time}") + "wrench.effects = {'extra_drag': {'coefficient': '0.1'}}",
            "effects is {'extra_drag': {'coefficient': '0.1'}}, expected settings by effect",
        ),
        ("def wrench(:\n", "cannot be run: SyntaxError"),
        ("1 / 0\n", "cannot be run: ZeroDivisionError: division by zero (line 1 of model.py)"),
    ],
)
def test_what_goes_wrong_is_said_in_one_sentence(function, record, text, words):
    with pytest.raises(DataError) as error:
        function(text).predict(record)
    assert words in str(error.value)
    assert "\n" not in str(error.value)


def test_a_file_that_changes_the_path_still_finds_its_neighbours_later(function, record, tmp_path):
    (tmp_path / "lib").mkdir()
    (tmp_path / "lib" / "gains.py").write_text("DRAG = 0.5\n")
    text = f"import sys\nsys.path.insert(0, {str(tmp_path / 'lib')!r})\n"
    late = "from gains import DRAG; return {'X': -DRAG * air['V'] ** 2}"
    assert np.allclose(function(text + wrench(late)).predict(record)[0], -0.5 * record["air/V"] ** 2)


def test_words_that_name_no_simulation_are_refused(tmp_path, function, record):
    with pytest.raises(DataError, match="no such file"):
        connect(str(tmp_path / "absent.py:wrench"))
    with pytest.raises(UsageError, match="did you mean 'wrench'"):
        function(GOOD, "wrenhc")
    with pytest.raises(UsageError, match="names no kind"):
        connect("simulation")
    with pytest.raises(UsageError, match="no simulation is given"):
        connect()


def test_a_derivative_of_a_coefficient_may_be_known_to_tens_only(function):
    """CZ_qhat is a number without unit, but no share."""
    simulation = function(GOOD + 'wrench.tolerances = {"CZ_qhat": (13.8, "1")}\n')
    assert simulation.tolerances == {"CZ_qhat": Tolerance(13.8, "1")}


@pytest.mark.parametrize(
    ("stated", "words"),
    [
        ("{'a': (0.1,)}", "tolerance 'a' is (0.1,), expected a pair of one sigma and its unit"),
        ("{'a': 0.1}", "tolerance 'a' is 0.1, expected a pair"),
        ("['a']", "tolerances is list, expected a dictionary"),
        ("{'a': (-0.1, '1')}", "['a']: a tolerance has sigma -0.1, expected a finite number"),
        ("{'a': (0.0, '1')}", "tolerance 'a' has sigma 0"),
        ("{'a': (float('inf'), '1')}", "has sigma inf"),
        ("{'a': ('5 %', '1')}", "has sigma '5 %'"),
        ("{'a': (True, '1')}", "has sigma True"),
        ("{'a': (0.1, 1)}", "has unit 1, expected a string"),
        ("{'extra_drag': (0.1, '1')}", "'extra_drag' has the name of an effect"),
    ],
)
def test_absurd_tolerances_are_refused(function, stated, words):
    with pytest.raises(DataError) as error:
        function(GOOD + f"wrench.tolerances = {stated}\n")
    assert words in str(error.value)
    assert "\n" not in str(error.value)


def flying(body):
    return f"""
import numpy as np
def wrench(time, state, effector, air, parameters):
    return {{"X": time}}
def fly(record, parameters):
    time, de = record.time, record["command/de"]
    {body}
wrench.fly = fly
"""


@pytest.mark.parametrize(
    ("body", "words"),
    [
        (
            "raise OverflowError('too large')",
            "from t = 0 to 2 s raised OverflowError: too large (line 7 of model.py)",
        ),
        ("return {'q': np.where(time < 1, de, np.nan)}", "not finite in 51 of 101 samples, first at t = 1 s"),
        ("return {'q': de[:-1]}", "has shape (100,), expected (101,)"),
        ("return {'q': 0.0}", "stands still from t = 0 s on, while the record's inputs move"),
        ("return {'q': np.where(time < 1, de, 0)}", "stands still from t = 1 s on"),
        ("return {'q': 1e-3 * np.exp(10 * time)}", "diverges: q is 109 rad/s at t = 1.16 s"),
        ("return {'effector/de': de}", "returned no state"),
        ("return {'effector/da': de}", "'effector/da', which is no channel of the record or the vehicle"),
        ("return {'Q': de}", "'Q', which is no channel"),
        ("return de", "returned ndarray, expected a dictionary"),
    ],
)
def test_a_flight_that_fails_is_one_sentence_with_the_time(function, record, body, words):
    with pytest.raises(DataError) as error:
        function(flying(body)).fly(record)
    assert words in str(error.value)
    assert "\n" not in str(error.value)
    assert error.value.exit_code == 3
