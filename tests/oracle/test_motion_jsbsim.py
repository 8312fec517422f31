"""The vehicle's motion and the atmosphere against JSBSim, an independent flight simulator.

JSBSim rounds its unit conversions (2e-9 for mass, 9e-5 for inertia), so the vehicle is described by
the mass properties that JSBSim says it uses.
"""

from __future__ import annotations

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from freqid.core.vehicle import Inertia, MassProperties, Vehicle
from freqid.simulate.air import atmosphere
from freqid.simulate.loads.quantities import Wrench
from freqid.simulate.motion import attitude, multibody, rigid_body
from freqid.simulate.motion.integrate import integrate, rk4
from freqid.simulate.motion.multibody import Configuration
from freqid.simulate.motion.rigid_body import BodyState

jsbsim = pytest.importorskip("jsbsim", reason="JSBSim is not installed")

FOOT, POUND_FORCE, SLUG = 0.3048, 4.4482216152605, 14.593902937206364
RADIUS, ALTITUDE = 1e9, 1000.0  # m; a planet so large that the Earth is flat over the flight

AIRCRAFT = """<?xml version="1.0"?>
<fdm_config name="brick" version="2.0" release="BETA">
  <fileheader/>
  <metrics>
    <wingarea unit="M2">1</wingarea><wingspan unit="M">1</wingspan><chord unit="M">1</chord>
    <location name="AERORP" unit="M"><x>0</x><y>0</y><z>0</z></location>
    <location name="EYEPOINT" unit="M"><x>0</x><y>0</y><z>0</z></location>
    <location name="VRP" unit="M"><x>0</x><y>0</y><z>0</z></location>
  </metrics>
  <mass_balance>
    <ixx unit="KG*M2">3.1</ixx><iyy unit="KG*M2">6.6</iyy><izz unit="KG*M2">9.2</izz>
    <ixy unit="KG*M2">0.2</ixy><ixz unit="KG*M2">-0.1</ixz><iyz unit="KG*M2">-0.15</iyz>
    <emptywt unit="KG">28.6</emptywt>
    <location name="CG" unit="M"><x>0</x><y>0</y><z>0</z></location>
  </mass_balance>
  <ground_reactions/><propulsion/><flight_control name="none"/><aerodynamics/>
  <external_reactions>
    <force name="push" frame="BODY">
      <location unit="M"><x>0</x><y>0</y><z>0</z></location><direction><x>1</x><y>0</y><z>0</z></direction>
    </force>
    <moment name="twist" frame="BODY"><direction><x>1</x><y>0</y><z>0</z></direction></moment>
  </external_reactions>
</fdm_config>
"""
PLANET = f"""<?xml version="1.0"?>
<planet name="flat">
  <semimajor_axis unit="M">{RADIUS}</semimajor_axis><semiminor_axis unit="M">{RADIUS}</semiminor_axis>
  <rotation_rate unit="RAD/SEC">0</rotation_rate><J2>0</J2>
  <GM unit="M3/SEC2">{9.80665 * (RADIUS + ALTITUDE) ** 2}</GM>
</planet>
"""


def simulator(folder, dt):
    (folder / "aircraft" / "brick").mkdir(parents=True, exist_ok=True)
    (folder / "aircraft" / "brick" / "brick.xml").write_text(AIRCRAFT)
    (folder / "planet.xml").write_text(PLANET)
    fdm = jsbsim.FGFDMExec(str(folder))
    fdm.set_debug_level(0)
    assert fdm.load_planet(str(folder / "planet.xml"), False)
    assert fdm.load_model("brick")
    fdm.set_dt(dt)
    assert fdm.run_ic()  # works the mass properties out
    return fdm


def apply(fdm, load):
    force, moment = np.split(load, 2)
    size, twist = np.linalg.norm(force), np.linalg.norm(moment)
    for axis, part in zip("xyz", force / size, strict=True):
        fdm[f"external_reactions/push/{axis}"] = part
    for axis, part in zip("lmn", moment / twist, strict=True):
        fdm[f"external_reactions/twist/{axis}"] = part
    fdm["external_reactions/push/magnitude"] = size / POUND_FORCE
    fdm["external_reactions/twist/magnitude-lbsft"] = twist / POUND_FORCE / FOOT


def begin(fdm, velocity, rates, angles):
    fdm["ic/h-sl-ft"] = ALTITUDE / FOOT
    for name, value in zip("uvw", velocity, strict=True):
        fdm[f"ic/{name}-fps"] = value / FOOT
    for name, value in zip("pqr", rates, strict=True):
        fdm[f"ic/{name}-rad_sec"] = value
    for name, value in zip(("phi", "theta", "psi-true"), angles, strict=True):
        fdm[f"ic/{name}-rad"] = value
    assert fdm.run_ic()


NONE = Configuration(*(jnp.zeros(0),) * 3)


def our_model(fdm):
    inertia = {n: fdm[f"inertia/i{n}-slugs_ft2"] * SLUG * FOOT**2 for n in ("xx", "yy", "zz", "xy", "yz")}
    inertia["xz"] = -fdm["inertia/ixz-slugs_ft2"] * SLUG * FOOT**2  # JSBSim's x points aft, its z up
    properties = MassProperties(mass_kg=fdm["inertia/mass-slugs"] * SLUG, inertia=Inertia(**inertia))
    return multibody.mass_model(Vehicle(name="brick", mass_properties=properties))


def our_state(velocity, rates, angles):
    arrays = (jnp.asarray(x) for x in (velocity, rates))
    return BodyState(jnp.zeros(3), attitude.from_euler(*angles), *arrays)


def test_accelerations_equal_those_of_jsbsim(tmp_path):
    fdm, rng = simulator(tmp_path, 0.005), np.random.default_rng(1)
    ours = jax.jit(partial(rigid_body.accelerations, our_model(fdm), NONE, NONE))
    for _ in range(8):
        velocity, rates = rng.normal(0, 10, 3), rng.normal(0, 1, 3)
        angles, load = rng.uniform(-1, 1, 3), rng.normal(0, [100, 100, 100, 5, 5, 5])
        apply(fdm, load)
        begin(fdm, velocity, rates, angles)
        along, turning = ours(our_state(velocity, rates, angles), Wrench(*jnp.split(load, 2)))
        theirs = [fdm[f"accelerations/{n}dot-ft_sec2"] * FOOT for n in "uvw"]
        assert np.allclose(along, theirs, atol=2e-6)
        assert np.allclose(turning, [fdm[f"accelerations/{n}dot-rad_sec2"] for n in "pqr"], rtol=1e-9)


def test_five_seconds_under_the_same_wrench_end_where_jsbsim_ends(tmp_path):
    start = (20.0, 1.0, 2.0), (0.3, -0.2, 0.4), (0.2, 0.1, 0.5)
    load, seconds, dt = np.array([12.0, -7.0, -230.0, 0.4, -0.6, 0.5]), 5.0, 0.002
    fdm = simulator(tmp_path, dt)
    for what in ("rate/rotational", "rate/translational", "position/rotational", "position/translational"):
        fdm[f"simulation/integrator/{what}"] = 4  # Adams-Bashforth of third order
    apply(fdm, load)
    begin(fdm, *start)
    for _ in range(round(seconds / dt)):
        fdm.run()
    model, push = our_model(fdm), Wrench(*jnp.split(load, 2))

    def step(body, _):
        slope = lambda b, _: rigid_body.derivative(model, NONE, NONE, b, push)  # noqa: E731
        return rigid_body.normalised(rk4(slope, body, 0.005))

    _, end = jax.jit(partial(integrate, step))(our_state(*start), jnp.zeros(round(seconds / 0.005)))
    phi, theta, psi = attitude.euler(end.attitude)
    assert np.allclose(end.velocity, [fdm[f"velocities/{n}-fps"] * FOOT for n in "uvw"], atol=1e-5)
    assert np.allclose(end.rates, [fdm[f"velocities/{n}-rad_sec"] for n in "pqr"], atol=1e-7)
    found = [phi, theta, psi % (2 * np.pi)]
    assert np.allclose(found, [fdm[f"attitude/{n}-rad"] for n in ("phi", "theta", "psi")], atol=1e-6)


def test_standard_atmosphere_equals_that_of_jsbsim(tmp_path):
    fdm = simulator(tmp_path, 0.01)
    for altitude in (0.0, 300.0, 2500.0, 9000.0, 14000.0):
        fdm["ic/h-sl-ft"] = altitude / FOOT
        assert fdm.run_ic()
        air = atmosphere.air(jnp.asarray(altitude))
        density = fdm["atmosphere/rho-slugs_ft3"] * SLUG / FOOT**3
        pressure = fdm["atmosphere/P-psf"] * POUND_FORCE / FOOT**2
        assert float(air.temperature) == pytest.approx(fdm["atmosphere/T-R"] / 1.8, rel=1e-8)
        assert float(air.pressure) == pytest.approx(pressure, rel=1e-5)  # JSBSim's sea level: 101325.5 Pa
        assert float(air.rho) == pytest.approx(density, rel=1e-5)
