"""The JSBSim aircraft: JSBSim loads it, finds the model's wrench, and flies as the equations of motion do."""

import dataclasses

import exported
import msgspec
import numpy as np
import pytest
import tilt_wing
from scipy.integrate import solve_ivp

from freqid.blend.exports.exact import exact, start_at, values_at
from freqid.blend.exports.jsbsim import write_jsbsim
from freqid.blend.exports.tabled import tabled
from freqid.blend.exports.usable_range import start_of
from freqid.core.errors import UsageError
from freqid.core.vehicle import Inertia, MassProperties, Rotor

jsbsim = pytest.importorskip("jsbsim", reason="JSBSim is not installed")

FOOT, POUND_FORCE, SLUG = 0.3048, 4.4482216152605, 14.593902937206364
G, RADIUS, ALTITUDE = 9.80665, 1e9, 50.0
MASS = MassProperties(
    mass_kg=28.6, inertia=Inertia(xx=3.1, yy=6.6, zz=9.2, xz=0.3, xy=0.1, yz=-0.2), cg_m=(0.1, 0.02, -0.05)
)
VEHICLE = msgspec.structs.replace(
    tilt_wing.VEHICLE,
    mass_properties=MASS,
    rotors=(
        Rotor(name="n1", spin=1, inertia=4e-3, wing="front"),
        Rotor(name="n2", spin=-1, inertia=7e-3, wing="rear", axis=(0.9, 0.0, -0.1)),
    ),
)
PLANET = f"""<?xml version="1.0"?>
<planet name="flat">
  <semimajor_axis unit="M">{RADIUS}</semimajor_axis><semiminor_axis unit="M">{RADIUS}</semiminor_axis>
  <rotation_rate unit="RAD/SEC">0</rotation_rate><J2>0</J2>
  <GM unit="M3/SEC2">{G * (RADIUS + ALTITUDE) ** 2}</GM>
</planet>
"""


def load(folder, model, dt=0.002):
    name = "craft"
    if hasattr(model, "corridor"):
        calculation, start = tabled(model), start_of(model)
    else:
        calculation, start = exact(model), start_at(model)
    write_jsbsim(folder / name, calculation, VEHICLE, start, "0")
    (folder / "planet.xml").write_text(PLANET)
    fdm = jsbsim.FGFDMExec(str(folder))
    fdm.set_debug_level(0)
    fdm.set_aircraft_path(str(folder))
    assert fdm.load_planet(str(folder / "planet.xml"), False)
    assert fdm.load_model(name, True)
    fdm.set_dt(dt)
    return fdm, calculation, start


def put(fdm, at):
    """Set a state, SI."""
    for name in "uvw":
        fdm[f"ic/{name}-fps"] = at[name] / FOOT
    for name in "pqr":
        fdm[f"ic/{name}-rad_sec"] = at[name]
    fdm["ic/h-sl-ft"] = ALTITUDE / FOOT
    fdm["ic/theta-rad"] = at.get("theta", 0.0)
    for name in ("n1", "n2", "df", "dr", "da", "dw1", "dw2"):
        fdm[f"freqid/effector/{name}"] = at[name]
    assert fdm.run_ic()


def flown(fdm, names):
    """Return what JSBSim says the state is, SI."""
    own = {n: fdm[f"velocities/{n}-aero-fps"] * FOOT for n in "uvw"}
    own |= {n: fdm[f"velocities/{n}-aero-rad_sec"] for n in "pqr"}
    own["rho"] = fdm["atmosphere/rho-slugs_ft3"] * SLUG / FOOT**3
    return {n: own[n] if n in own else fdm[f"freqid/effector/{n}"] for n in names}


def momentum(at):
    """Return the rotors' angular momentum, written down here again."""
    total = np.zeros(3)
    for rotor in VEHICLE.rotors:
        tilt = at["dw1"] if rotor.wing == "front" else at["dw2"]
        x, _, z = np.array(rotor.axis) / np.linalg.norm(rotor.axis)
        axis = np.array([x * np.cos(tilt) + z * np.sin(tilt), 0.0, z * np.cos(tilt) - x * np.sin(tilt)])
        total += rotor.spin * rotor.inertia * at[rotor.name] * axis
    return total


@pytest.mark.parametrize("name", ["point", "one_line", "two_lines"])
def test_jsbsim_finds_the_wrench_of_the_model(tmp_path, name):
    model = getattr(exported, name)()
    fdm, calculation, _ = load(tmp_path, model)
    several = exported.one_line()
    states = exported.states(several, 12, seed=2)
    for i in range(12):
        put(fdm, {n: float(v[i]) for n, v in states.items()})
        at = flown(fdm, several.inputs)
        if name == "point":
            truth = values_at(model, {n: np.array([v]) for n, v in at.items()})[0][:, 0]
            parts = {
                r: np.abs(m.estimate) @ np.abs([at[n] for n in m.regressors])
                for r, m in model.responses.items()
            }
            limits = {r: 1e-12 * size for r, size in parts.items()}
        else:
            result = model.wrench(at, outside="hold")
            truth, limits = result.values[:, 0], calculation.bounds
            assert fdm["freqid/outside"] == float(result.outside[0])
        for response, value in zip("XYZLMN", truth, strict=True):
            assert abs(fdm[f"freqid/{response}"] - value) <= limits[response], response
        force = [fdm[f"forces/fb{n}-aero-lbs"] * POUND_FORCE for n in "xyz"]
        np.testing.assert_allclose(force, [fdm[f"freqid/{r}"] for r in "XYZ"], rtol=1e-12, atol=1e-9)
        # moments hold for the centre of gravity: nothing is added on the way, but the rotors' momentum
        rates = np.array([fdm[f"velocities/{n}-rad_sec"] for n in "pqr"])
        moment = np.array([fdm[f"moments/{n}-aero-lbsft"] for n in "lmn"]) * POUND_FORCE * FOOT
        whole = np.array([fdm[f"freqid/{r}"] for r in "LMN"]) - np.cross(rates, momentum(at))
        np.testing.assert_allclose(moment, whole, rtol=1e-9, atol=1e-9)


def test_it_flies_three_seconds_as_the_equations_of_motion_do(tmp_path):
    model = exported.one_line()
    fdm, calculation, start = load(tmp_path, model)
    for what in ("rate/rotational", "rate/translational", "position/rotational", "position/translational"):
        fdm[f"simulation/integrator/{what}"] = 4  # Adams-Bashforth of third order
    begin = start | {"p": 0.05, "q": -0.03, "r": 0.04, "v": 0.3, "w": start["w"] + 0.2, "df": 0.15}
    put(fdm, begin)
    at = flown(fdm, model.inputs)
    for _ in range(1500):
        fdm.run()
    end = flown(fdm, model.inputs)
    # JSBSim rounds its units of mass and inertia, so those that it says it has are used.
    mass = fdm["inertia/mass-slugs"] * SLUG
    np.testing.assert_allclose(mass, MASS.mass_kg, rtol=1e-7)
    J, h = MASS.inertia.matrix, momentum(at)
    names = ("u", "v", "w", "p", "q", "r")

    def slope(_, x):
        velocity, rates, (phi, theta) = x[:3], x[3:6], x[6:]
        load = calculation.evaluate(at | dict(zip(names, x, strict=False)))
        force, moment = (np.array([load[r][0] for r in axes]) for axes in ("XYZ", "LMN"))
        down = np.array([-np.sin(theta), np.sin(phi) * np.cos(theta), np.cos(phi) * np.cos(theta)])
        turn = np.linalg.solve(J, moment - np.cross(rates, J @ rates + h))
        p, q, r = rates
        angles = [p + np.tan(theta) * (q * np.sin(phi) + r * np.cos(phi)), q * np.cos(phi) - r * np.sin(phi)]
        return np.concatenate([force / mass + G * down - np.cross(rates, velocity), turn, angles])

    x0 = [at[n] for n in names] + [0.0, begin["theta"]]
    ours = solve_ivp(slope, (0, 3.0), x0, rtol=1e-7, atol=1e-8).y[:, -1]
    theirs = [end[n] for n in names] + [fdm["attitude/phi-rad"], fdm["attitude/theta-rad"]]
    assert np.abs(ours[:3] - np.array(x0)[:3]).max() > 0.5  # it went somewhere
    np.testing.assert_allclose(theirs, ours, atol=2e-3 * np.abs(ours).max())
    np.testing.assert_allclose(theirs[3:], ours[3:], atol=2e-3)


def test_the_start_is_the_trim(tmp_path):
    model = exported.one_line()
    fdm, _, start = load(tmp_path, model)
    assert fdm.load_ic("start", True)
    assert fdm.run_ic()
    at = flown(fdm, model.inputs)
    for name, value in at.items():
        rounded = 2e-5 if name == "rho" else 1e-6  # JSBSim's sea level: 101325.5 Pa
        assert value == pytest.approx(start[name], rel=rounded, abs=1e-6), name
    along = [fdm[f"accelerations/{n}dot-ft_sec2"] * FOOT for n in "uvw"]
    assert np.abs(along).max() < 0.1  # the tilt-wing's points are trimmed


def test_other_models_are_refused(tmp_path):
    calculation = exact(exported.point())
    with pytest.raises(UsageError, match=r"needs X Y Z L M N in N and N m, found .* in form 'coefficient'"):
        write_jsbsim(tmp_path / "a", dataclasses.replace(calculation, form="coefficient"), VEHICLE, {}, "0")
    other = dataclasses.replace(calculation, outputs={"CL": "X"})
    with pytest.raises(UsageError, match="found CL in form"):
        write_jsbsim(tmp_path / "a", other, VEHICLE, {}, "0")
    assert not (tmp_path / "a").exists()
