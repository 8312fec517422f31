"""What a reference condition sets beside speed and density: any effector or air quantity, by its name."""

from __future__ import annotations

import pytest

from freqid.core.errors import UsageError
from freqid.core.scenario import Reference, read_scenario

VEHICLE = """
[vehicle]
name = "own"
mass_kg = 10.0
inertia = { xx = 1.0, yy = 1.0, zz = 1.5 }
"""
NACELLES = "".join(
    f'[[effector]]\nname = "nac_{side}"\nkind = "tilt"\nlimits = [0.0, 1.6]\n'
    for side in ("fl", "fr", "rl", "rr")
)
FLAP = '[[effector]]\nname = "flap"\nkind = "surface"\nlimits = [0.0, 0.7]\n'


def scenario(tmp_path, *parts):
    path = tmp_path / "own.toml"
    path.write_text(VEHICLE + "".join(parts))
    return read_scenario(path)[0]


def reference(**sets):
    return "[[reference]]\n" + "".join(f"{k} = {v!r}\n".replace("'", '"') for k, v in sets.items())


def test_any_number_of_angles_is_set_by_name(tmp_path):
    at = {"id": "u20", "u": 20, "rho": 1.2, "nac_fl": 0.3, "nac_rr": 0.4, "flap": 0.1, "alpha": 0.05}
    found = scenario(tmp_path, NACELLES, FLAP, reference(**at)).reference[0]
    assert found.scheduled == {"nac_fl": 0.3, "nac_rr": 0.4, "flap": 0.1, "alpha": 0.05}
    assert found["nac_rr"] == 0.4
    assert found == Reference.of(**at) == Reference.from_json(found.to_json())


@pytest.mark.parametrize(
    ("sets", "says"),
    [
        ({"nac_rl2": 0.3}, r"'u20' sets 'nac_rl2', .* did you mean 'nac_rl'"),
        ({"dw1": 0.3}, "'u20' sets 'dw1', which is no effector"),
        ({"rhoo": 1.2}, "did you mean 'rho'"),
        ({"flap": "half"}, r"at reference.0..scheduled.*expected `float`, got `str`"),
        ({"flap": float("inf")}, r"flap: found inf, expected a finite number"),
    ],
)
def test_what_is_no_variable_is_refused_with_the_nearest(tmp_path, sets, says):
    with pytest.raises(UsageError, match=says) as caught:
        scenario(tmp_path, NACELLES, FLAP, reference(id="u20", u=20, rho=1.2, **sets))
    assert "own.toml" in str(caught.value)


def test_the_two_angles_of_earlier_files_are_those_of_the_wings(tmp_path):
    """Files of releases that knew dw1 and dw2 only, whatever the tilts were called."""
    wings = "".join(f'[[wing]]\nname = "w{n}"\ntilt = "nac_{n}"\npivot_m = [0, 0, 0]\n' for n in ("fl", "rr"))
    old = reference(id="u20", u=20, rho=1.2, dw1=0.3, dw2=0.4)
    assert scenario(tmp_path, NACELLES, wings, old).reference[0].scheduled == {"nac_fl": 0.3, "nac_rr": 0.4}
    still = reference(id="u20", u=20, rho=1.2, dw1=0, dw2=0)
    assert scenario(tmp_path, still).reference[0].scheduled == {}  # nothing tilts
    la8 = read_scenario("la8")[0].reference_of("u45")
    assert la8.scheduled == {"dw1": 0.3840, "dw2": 0.3840}


def test_an_advance_ratio_is_known_where_rotors_have_a_diameter(tmp_path):
    rotor = '[[rotor]]\nname = "n1"\nspin = 1\ninertia = 0.0\n'
    at = reference(id="u20", u=20, rho=1.2, J=0.6)
    found = scenario(tmp_path, NACELLES, rotor, "diameter_m = 0.4\n", at)
    assert found.reference[0]["J"] == 0.6
    with pytest.raises(UsageError, match="sets 'J', which is no effector"):
        scenario(tmp_path, NACELLES, rotor, at)
