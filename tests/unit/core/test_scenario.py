import pytest

from freqid.core.errors import DataError, UsageError
from freqid.core.scenario import Scenario, read_scenario
from freqid.core.vehicle import Group

GOOD = """
[vehicle]
name = "test"
mass_kg = 10.0
inertia = {xx = 2.0, yy = 3.0, zz = 4.0, xz = 0.1}
[[effector]]
name = "de"
kind = "surface"
limits = [-0.3, 0.3]
[[reference]]
id = "cruise"
u = 20.0
rho = 1.2
[excitation]
band_hz = [0.05, 1.8]
period_s = 60.0
[identification]
regressors = ["u", "w", "q", "de"]
frequencies_hz = {start = 0.1, step = 0.02, stop = 1.5}
"""


@pytest.fixture
def scenario(tmp_path):
    def read(text):
        (tmp_path / "s.toml").write_text(text)
        return read_scenario(tmp_path / "s.toml")[0]

    return read


def test_a_scenario_is_read_into_an_aircraft_and_its_work(scenario):
    read = scenario(GOOD)
    assert read.aircraft().mass_properties.inertia.matrix[0, 2] == -0.1
    assert read.excitation.band_hz == (0.05, 1.8)
    assert read.identification.frequencies_hz.step == 0.02
    assert read.identification.regressors_of("Z") == ("u", "w", "q", "de")
    assert read.reference_of("cruise").u == 20.0
    with pytest.raises(UsageError, match="no reference 'cruse'; did you mean 'cruise'"):
        read.reference_of("cruse")


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("mass_kg", "mas_kg", r"at vehicle: key 'mas_kg' is unknown; did you mean 'mass_kg'"),
        ("limits", "limit", r"at effector\[0\]: key 'limit' is unknown; did you mean 'limits'"),
        ("[excitation]", "[excitatoin]", r"at the top level: key 'excitatoin'.*'excitation'"),
        ("mass_kg = 10.0", 'mass_kg = "10"', r"at vehicle.mass_kg: expected `float`, got `str`"),
        ("mass_kg = 10.0", "mass_kg = -1.0", r"mass_kg is -1, expected a positive mass"),
        ("zz = 4.0", "zz = 6.0", r"none exceeds the sum of the other two"),
        ("[-0.3, 0.3]", "[0.3, -0.3]", r"at effector\[0\]: limits of 'de'"),
        (
            "[-0.3, 0.3]",
            "[-17, 17]",
            r"limits of 'de' are .* full turn.*in degrees, state \[-0.2967, 0.2967\]",
        ),
        ('"surface"', '"flap"', r"at effector\[0\].kind: invalid enum value 'flap'"),
        ("step = 0.02", "step = 0.0", r"at identification.frequencies_hz: .*step > 0"),
        ('regressors = ["u", "w", "q", "de"]', "", r"missing required field `regressors`"),
    ],
)
def test_a_slip_is_named_with_its_path(scenario, old, new, says):
    with pytest.raises(UsageError, match=says):
        scenario(GOOD.replace(old, new))


def test_what_does_not_fit_together_is_refused(scenario):
    with pytest.raises(UsageError, match="more than once"):
        scenario(
            GOOD.replace(
                "[[reference]]", '[[effector]]\nname = "de"\nkind = "surface"\nlimits = [0, 1]\n[[reference]]'
            )
        )
    with pytest.raises(UsageError, match="rotor 'n1' is on wing 'front', which is not described"):
        scenario(GOOD + '[[rotor]]\nname = "n1"\nspin = 1\ninertia = 1e-4\nwing = "front"\n')


def test_no_toml_and_no_file_are_data_errors(scenario, tmp_path):
    with pytest.raises(DataError, match=r"s\.toml: is no valid TOML .*line 1"):
        scenario("[vehicle\n")
    with pytest.raises(DataError, match="cannot be read"):
        read_scenario(tmp_path / "absent.toml")


ROTORS = """
[[effector]]
name = "elevon_left"
kind = "surface"
limits = [-0.3, 0.3]
[[effector]]
name = "elevon_right"
kind = "surface"
limits = [-0.3, 0.3]
""" + "".join(
    f"""
[[effector]]
name = "n{i}"
kind = "rotor"
limits = [0, 900]
[[rotor]]
name = "n{i}"
spin = 1
inertia = 1e-4
position_m = [{x}, 0, 0]
"""
    for i, x in ((1, 0.5), (2, 0.5), (3, -0.5))
)
GROUP = """
[[group]]
name = "pair"
effectors = ["elevon_left", "elevon_right"]
kind = "one servo bus"
"""


def test_groups_are_stated(scenario):
    stated = scenario(GOOD + ROTORS + GROUP).aircraft().groups
    assert stated == (Group(name="pair", effectors=("elevon_left", "elevon_right"), kind="one servo bus"),)
    assert scenario(GOOD).aircraft().groups == ()


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ('"elevon_right"]', '"elevon_rigt"]', "names effector 'elevon_rigt'.*did you mean 'elevon_right'"),
        (', "elevon_right"]', "]", "expected two or more, each once"),
        ('"elevon_right"]', '"elevon_left"]', "expected two or more, each once"),
        ('name = "pair"', 'name = ""', "a group has no name"),
        ("kind", "kin", "key 'kin' is unknown"),
    ],
)
def test_a_group_that_is_none_is_refused(scenario, old, new, says):
    with pytest.raises(UsageError, match=says):
        scenario(GOOD + ROTORS + GROUP.replace(old, new))
    with pytest.raises(UsageError, match=r"groups name .* more than once"):
        scenario(GOOD + ROTORS + GROUP + GROUP)


def test_tolerances_of_one_effector_have_dotted_names(scenario):
    stated = '[tolerance]\nmass = 0.01\nde.natural_frequency = 0.05\n"n1.thrust" = 0.03\nwing.front.span_m=1'
    read = scenario(GOOD + stated)
    assert read.tolerance == {
        "mass": 0.01,
        "de.natural_frequency": 0.05,
        "n1.thrust": 0.03,
        "wing.front.span_m": 1.0,
    }
    assert type(read) is Scenario
    for slip in ('de.gain = "5 %"', 'mass = "5 %"'):
        with pytest.raises(UsageError, match=r"at tolerance.*`str`"):
            scenario(GOOD + "[tolerance]\n" + slip)
