"""The vehicle's motion against point masses, closed forms, conservation laws and JSBSim."""

from __future__ import annotations

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from point_masses import TiltWingAircraft
from scipy.integrate import cumulative_simpson
from scipy.signal import welch
from scipy.spatial.transform import Rotation

from freqid.core.vehicle import Inertia, MassProperties, Rotor, Vehicle, Wing
from freqid.simulate.air import atmosphere
from freqid.simulate.air import dryden as turbulence
from freqid.simulate.loads.quantities import Wrench
from freqid.simulate.motion import attitude, multibody, rigid_body
from freqid.simulate.motion.integrate import integrate, rk4
from freqid.simulate.motion.multibody import Configuration
from freqid.simulate.motion.rigid_body import BodyState

GRAVITY = 9.80665
STILL = Wrench(jnp.zeros(3), jnp.zeros(3))


def state(velocity=(0.0, 0.0, 0.0), rates=(0.0, 0.0, 0.0), angles=(0.0, 0.0, 0.0)):
    arrays = (jnp.asarray(x, dtype=float) for x in (velocity, rates))
    return BodyState(jnp.zeros(3), attitude.from_euler(*angles), *arrays)


def rigid(inertia: Inertia, cg=(0.0, 0.0, 0.0), mass=28.6):
    properties = MassProperties(mass_kg=mass, inertia=inertia, cg_m=cg)
    return multibody.mass_model(Vehicle(name="brick", mass_properties=properties))


def tilt_wing():
    """Two wings of a third of the mass, four fast rotors, products of inertia everywhere."""
    wings = tuple(
        Wing(
            name=name,
            tilt=f"dw{k + 1}",
            pivot_m=(x, 0.0, -0.1 * k),
            mass_kg=5.0,
            cg_m=(x + 0.15, 0.02, 0.05 - 0.1 * k),
            inertia=Inertia(xx=1.3, yy=0.08, zz=1.35, xz=0.03, xy=0.01, yz=0.02),
        )
        for k, (name, x) in enumerate((("front", 0.6), ("rear", -0.65)))
    )
    rotors = tuple(
        Rotor(name=f"n{k + 1}", spin=(-1) ** (k // 2), inertia=4e-3, axis=(1.0, 0.05 * k, -0.1), wing=wing)
        for k, wing in enumerate(("front", "front", "rear", None))
    )
    inertia = Inertia(xx=4.1, yy=7.6, zz=9.9, xz=0.2, xy=0.05, yz=-0.04)
    properties = MassProperties(mass_kg=28.6, cg_m=(0.07, 0.01, 0.03), inertia=inertia)
    tilts = {"front": 0.3, "rear": 0.5}
    return Vehicle(name="tw", mass_properties=properties, tilt_rad=tilts, wings=wings, rotors=rotors)


def inner_motion(time):
    """Tilts, rotor speeds and their rates of change as functions of time, numpy or JAX."""

    def positions(t):
        tilt = jnp.stack([0.8 + 0.7 * jnp.sin(0.9 * t), 0.6 - 0.8 * jnp.sin(0.7 * t + 0.4)])
        return tilt, 500.0 + 150.0 * jnp.sin(jnp.array([1.1, 0.8, 1.7, 0.5]) * t + 1.0)

    (tilt, speed), (rate, acceleration) = jax.jvp(positions, (time,), (1.0,))
    curvature = jax.jvp(lambda t: jax.jvp(positions, (t,), (1.0,))[1][0], (time,), (1.0,))[1]
    return Configuration(tilt, rate, speed), Configuration(rate, curvature, acceleration)


def test_accelerations_equal_those_of_point_masses():
    # Force and moment come from Newton's law for 9 + 2 (6 + 16) points in inertial axes.
    oracle = TiltWingAircraft(np.linspace(0, 6, 41))
    model = multibody.mass_model(oracle.vehicle)
    tilts, speeds = list(oracle.tilts.values()), list(oracle.speeds.values())
    wrench = oracle.force_and_moment()
    down = oracle._columns[2]  # the third row of the matrix that takes body components to inertial ones
    quaternion = Rotation.from_matrix(np.moveaxis(oracle._columns, 2, 0)).as_quat()[:, [3, 0, 1, 2]]

    @jax.jit
    @jax.vmap
    def turn(configuration, rate, body, wrench):
        at = multibody.traced_centre_of_gravity(model, configuration.tilt)
        about_origin = Wrench(wrench[:3], wrench[3:] + jnp.cross(at, wrench[:3]))
        return rigid_body.accelerations(model, configuration, rate, body, about_origin)

    velocity = oracle.to_body(np.array([x.d for x in oracle.path]))
    still = np.zeros_like(oracle.time)
    configuration = Configuration(
        *(np.array(c).T for c in ([x.v for x in tilts], [x.d for x in tilts], speeds))
    )
    # The oracle's rotor angles are functions of time; their second derivative is the rotors' acceleration.
    number = np.arange(1, 9)[:, None]
    rates = 0.4 + 0.1 * number
    spin_up = 24.0 + 60.0 * rates * np.cos(rates * oracle.time + number)
    change = Configuration(*(np.array(c).T for c in ([x.d for x in tilts], [x.dd for x in tilts], spin_up)))
    body = BodyState(np.stack([still] * 3, axis=1), quaternion, velocity.T, oracle.rates.T)
    got_v, got_w = turn(configuration, change, body, wrench.T)
    expected_v = oracle.specific_force((0.0, 0.0, 0.0)) + GRAVITY * down
    expected_v = expected_v - np.cross(oracle.rates, velocity, axis=0)
    assert np.max(np.abs(got_w.T - oracle.acceleration)) < 1e-9 * np.max(np.abs(oracle.acceleration))
    assert np.max(np.abs(got_v.T - expected_v)) < 1e-9 * np.max(np.abs(expected_v))


@pytest.fixture(scope="module")
def tumbling():
    """60 s of the tilt wing tumbling without air or weight, wings and rotors moving: (time, bodies, ...)."""
    model, dt, every = multibody.mass_model(tilt_wing()), 0.005, 4
    start = state((3.0, -2.0, 1.0), (0.5, -0.3, 0.7), (0.3, 0.2, -1.0))

    def derivative(t, body):
        return rigid_body.derivative(model, *inner_motion(t), body, STILL, gravity=0.0)

    def step(body, t):
        return rigid_body.normalised(rk4(lambda b, elapsed: derivative(t + elapsed, b), body, dt))

    def observe(body, t):
        return body, *inner_motion(t), derivative(t, body)

    time = dt * jnp.arange(60 / dt + every)
    seen, _ = jax.jit(partial(integrate, step, observe=observe, every=every))(start, time)
    return model, time[::every], seen


def test_momentum_without_air_is_kept_with_spinning_rotors_and_moving_wings(tumbling):
    model, time, (body, inner, _, _) = tumbling

    @jax.jit
    @jax.vmap
    def in_space(body, inner):
        linear, angular = multibody.momentum(model, inner, body.velocity, body.rates)
        angular -= jnp.cross(multibody.traced_centre_of_gravity(model, inner.tilt), linear)
        return attitude.to_ground(body.attitude, linear), attitude.to_ground(body.attitude, angular)

    linear, angular = in_space(body, inner)
    assert time[-1] >= 60
    for kept in (np.array(linear), np.array(angular)):
        assert np.max(np.abs(kept - kept[0])) < 1e-8 * np.linalg.norm(kept[0])
    # The test would be empty if nothing turned: the share of the rotors and the rates do change.
    assert np.ptp(body.rates, axis=0).min() > 0.5


def test_work_of_tilt_drives_and_motors_is_what_the_energy_gains(tumbling):
    # Kinetic energy part by part; torques inside by Newton and Euler for each wing and rotor alone.
    _, time, (body, inner, change, rate) = tumbling
    vehicle = tilt_wing()
    whole = vehicle.mass_properties
    t, v, w = (np.array(x) for x in (time, body.velocity, body.rates))
    a_origin = np.asarray(rate.velocity) + np.cross(w, v)
    w_dot = np.array(rate.rates)
    tilt, tilt_rate, speed = (np.array(x) for x in inner)
    tilt_acceleration, spin_up = np.array(change.tilt_rate), np.array(change.speed)
    y = np.array([0.0, 1.0, 0.0])

    def turned(angle, vector):
        return Rotation.from_rotvec(np.outer(angle, y)).apply(vector)

    def of(mass, inertia, place, velocity, rates):
        return 0.5 * mass * (velocity**2).sum(1) + 0.5 * np.einsum("ti,tij,tj->t", rates, inertia, rates)

    def lies(mass, place):
        return mass * (place @ place * np.eye(3) - np.outer(place, place))

    power = np.zeros(t.size)
    body_mass, moment = whole.mass_kg, whole.mass_kg * np.array(whole.cg_m)
    about_origin = whole.inertia.matrix + lies(whole.mass_kg, np.array(whole.cg_m))
    energy = np.zeros(t.size)
    for k, wing in enumerate(vehicle.wings):
        arm = np.subtract(wing.cg_m, wing.pivot_m)
        turn = Rotation.from_rotvec(vehicle.tilt_rad[wing.name] * y).as_matrix()
        home = wing.pivot_m + turn @ arm
        body_mass, moment = body_mass - wing.mass_kg, moment - wing.mass_kg * home
        about_origin = about_origin - turn @ wing.inertia.matrix @ turn.T - lies(wing.mass_kg, home)

        spin, spin_dot = np.outer(tilt_rate[:, k], y), np.outer(tilt_acceleration[:, k], y)
        w_wing = w + spin
        w_wing_dot = w_dot + spin_dot + np.cross(w, spin)  # seen from space
        arm_now, pivot = turned(tilt[:, k], arm), np.array(wing.pivot_m)
        velocity = v + np.cross(w, pivot) + np.cross(w_wing, arm_now)
        acceleration = a_origin + np.cross(w_dot, pivot) + np.cross(w, np.cross(w, pivot))
        acceleration += np.cross(w_wing_dot, arm_now) + np.cross(w_wing, np.cross(w_wing, arm_now))
        turns = Rotation.from_rotvec(np.outer(tilt[:, k], y)).as_matrix()
        inertia = turns @ wing.inertia.matrix @ turns.transpose(0, 2, 1)
        energy += of(wing.mass_kg, inertia, arm_now, velocity, w_wing)
        own = np.einsum("tij,tj->ti", inertia, w_wing)
        torque = np.einsum("tij,tj->ti", inertia, w_wing_dot) + np.cross(w_wing, own)
        torque += np.cross(arm_now, wing.mass_kg * acceleration)
        for number, rotor in enumerate(vehicle.rotors):
            if rotor.wing == wing.name:
                e = turned(tilt[:, k], np.array(rotor.axis) / np.linalg.norm(rotor.axis))
                torque += rotor_reaction(rotor, e, w_wing, speed[:, number], spin_up[:, number])
                energy += rotor_energy(rotor, e, w_wing, speed[:, number])
                power += motor_power(rotor, e, w_wing, w_wing_dot, speed[:, number], spin_up[:, number])
        power += tilt_rate[:, k] * torque[:, 1]
    own = about_origin - lies(body_mass, moment / body_mass)
    place = moment / body_mass
    energy += of(body_mass, np.broadcast_to(own, (t.size, 3, 3)), place, v + np.cross(w, place), w)
    for number, rotor in enumerate(vehicle.rotors):
        if rotor.wing is None:
            e = np.broadcast_to(np.array(rotor.axis) / np.linalg.norm(rotor.axis), w.shape)
            energy += rotor_energy(rotor, e, w, speed[:, number])
            power += motor_power(rotor, e, w, w_dot, speed[:, number], spin_up[:, number])
    work = cumulative_simpson(power, x=t, initial=0.0)
    assert np.ptp(work) > 100.0  # J
    assert np.max(np.abs(energy - energy[0] - work)) < 1e-7 * np.ptp(work)


def rotor_energy(rotor, e, w_mount, speed):
    """What spinning adds to the energy of the locked rotor, J."""
    relative = rotor.spin * speed
    return rotor.inertia * (relative * (e * w_mount).sum(1) + 0.5 * relative**2)


def rotor_reaction(rotor, e, w_mount, speed, spin_up):
    """Rate of change of the spin's momentum, N m: what the mount must give."""
    h = rotor.spin * rotor.inertia
    return h * (spin_up[:, None] * e + speed[:, None] * np.cross(w_mount, e))


def motor_power(rotor, e, w_mount, w_mount_dot, speed, spin_up):
    """Axial torque times relative speed, W; the axis itself turns with the mount."""
    axial = (e * w_mount_dot).sum(1) + rotor.spin * spin_up  # w . de/dt = w . (w x e) = 0
    return rotor.inertia * axial * rotor.spin * speed


def test_a_brick_thrown_spinning_falls_on_a_parabola():
    cg, dt = np.array([0.2, -0.1, 0.05]), 0.0025
    model = rigid(Inertia(xx=3.0, yy=6.0, zz=8.0, xz=0.3), tuple(cg))
    none = Configuration(*(jnp.zeros(0),) * 3)
    start = state((15.0, 2.0, -8.0), (0.8, 0.5, -0.6), (0.1, 0.3, 0.9))

    def step(body, _):
        slope = lambda b, _: rigid_body.derivative(model, none, none, b, STILL)  # noqa: E731
        return rigid_body.normalised(rk4(slope, body, dt))

    flown, _ = jax.jit(partial(integrate, step, every=40))(start, jnp.zeros(4000))
    turns = Rotation.from_quat(np.asarray(flown.attitude)[:, [1, 2, 3, 0]])
    centre = np.asarray(flown.position) + turns.apply(cg)
    velocity = turns[0].apply(np.asarray(start.velocity) + np.cross(start.rates, cg))
    t = np.arange(100)[:, None] * dt * 40
    expected = centre[0] + velocity * t + 0.5 * GRAVITY * t**2 * np.array([0, 0, 1])
    assert np.max(np.abs(centre - expected)) < 1e-9


@partial(jax.jit, static_argnames=("inertia", "steps"))
def torque_free(inertia, rates, dt, steps):
    """A body turning freely: its states over `steps` steps."""
    model, none = rigid(inertia), Configuration(*(jnp.zeros(0),) * 3)
    slope = lambda b, _: rigid_body.derivative(model, none, none, b, STILL, gravity=0.0)  # noqa: E731
    start = state(rates=rates, angles=(0.2, -0.3, 0.4))
    return integrate(lambda b, _: rk4(slope, b, dt), start, jnp.zeros(steps))[0]


def test_a_symmetric_top_precesses_as_in_closed_form():
    # Goldstein, Classical Mechanics, 3rd ed., sec. 5.6: about H at H / I1, and about the body's own axis.
    i1, i3, dt = 2.0, 3.2, 0.01
    flown = torque_free(Inertia(xx=i1, yy=i1, zz=i3), (0.9, 0.0, 1.5), dt, 1000)
    t = np.arange(1000) * dt
    turns = Rotation.from_quat(np.asarray(flown.attitude)[:, [1, 2, 3, 0]])
    momentum = turns[0].apply([i1 * 0.9, 0.0, i3 * 1.5])
    precession = Rotation.from_rotvec(np.outer(t, momentum / i1))
    own = Rotation.from_rotvec(np.outer(t * 1.5 * (1 - i3 / i1), [0, 0, 1]))
    error = (precession * turns[0] * own).inv() * turns
    assert np.max(error.magnitude()) < 1e-7
    wobble = 1.5 * (i3 - i1) / i1
    assert np.allclose(flown.rates[:, 0], 0.9 * np.cos(wobble * t), atol=1e-8)
    assert np.allclose(flown.rates[:, 1], 0.9 * np.sin(wobble * t), atol=1e-8)


def test_runge_kutta_converges_with_the_fourth_order():
    # Errors at t = 8 s against steps sixteen times as fine: one run, whose samples serve all.
    inertia, rates = Inertia(xx=2.0, yy=3.0, zz=4.5, xz=0.4), (1.1, 0.7, -0.9)
    exact = torque_free(inertia, rates, 0.005, 1601)
    errors = []
    for step in (0.16, 0.08, 0.04):
        flown, last = torque_free(inertia, rates, step, 1601), round(8 / step)
        pairs = zip(flown, exact, strict=True)
        errors.append(max(float(jnp.max(jnp.abs(a[last] - b[-1]))) for a, b in pairs))
    assert np.log2(errors[0] / errors[1]) == pytest.approx(4.0, abs=0.2)
    assert np.log2(errors[1] / errors[2]) == pytest.approx(4.0, abs=0.1)


@pytest.mark.parametrize(
    ("altitude", "temperature", "pressure", "density"),
    # U.S. Standard Atmosphere 1976, table I, geometric altitude.
    [
        (0.0, 288.150, 101325.0, 1.2250),
        (1000.0, 281.651, 89876.3, 1.1117),
        (5000.0, 255.676, 54048.3, 0.73643),
        (11000.0, 216.774, 22699.9, 0.36480),
        (15000.0, 216.650, 12111.8, 0.19475),
    ],
)
def test_standard_atmosphere_equals_its_table(altitude, temperature, pressure, density):
    air = atmosphere.air(jnp.asarray(altitude))
    assert float(air.temperature) == pytest.approx(temperature, abs=6e-4)
    assert float(air.pressure) == pytest.approx(pressure, rel=6e-6)
    assert float(air.rho) == pytest.approx(density, rel=5e-5)  # half a unit of the last digit


def test_turbulence_has_the_spectrum_of_the_specification():
    dryden = turbulence.low_altitude(wind_20ft=7.7, height=60.0, airspeed=20.0, span=1.83)
    dt, samples, seeds, piece = 0.02, 16384, 6, 1024
    densities = []
    for seed in range(seeds):
        f, density = welch(turbulence.gusts(dryden, samples, dt, seed), 1 / dt, nperseg=piece, detrend=False)
        densities.append(density)
    band = slice(8, piece // 8)  # above the window's leakage from the steep low end, below aliasing
    expected = 2 * np.pi * dryden.spectrum(2 * np.pi * f[band])
    ratio = np.mean(densities, axis=0)[:, band] / expected
    pieces = seeds * (2 * samples / piece - 1)
    one = np.sqrt(1.2 / pieces)  # of a line: half-overlapping Hann pieces are 1.2 times fewer
    lines = ratio.shape[1] / 1.5  # neighbouring lines of a Hann window are correlated
    assert np.all(np.abs(ratio.mean(axis=1) - 1) < 4 * one / np.sqrt(lines) + 0.01)
    assert np.all(np.abs(ratio - 1) < 4.5 * one)
    # Samples a minute apart are independent: the variance of 6400 is known to 1.8 %.
    variance = turbulence.gusts(dryden, 6400, 60.0, 0).var(axis=1)
    omega = np.geomspace(1e-5, 1e4, 20000)
    assert np.allclose(variance, np.trapezoid(dryden.spectrum(omega), omega), rtol=0.07)
