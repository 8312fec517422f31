"""Wings by strips: lifting line while attached, flat plate beyond stall, to +-180 degrees."""

from __future__ import annotations

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray

from freqid.dynamics import precision as precision


def strip_edges(span: float, count: int) -> NDArray[np.float64]:
    """Return strip ends that crowd towards the tips, where the circulation falls steeply.

    Parameters
    ----------
    span : float
        m.
    count : int
        Strips.

    Returns
    -------
    ndarray, shape (count + 1,)
        Spanwise positions from the left tip to the right, m.
    """
    return -0.5 * span * np.cos(np.pi * np.arange(count + 1) / count)


def strip_centres(span: float, count: int) -> NDArray[np.float64]:
    """Return where the flow of each strip of `strip_edges` is evaluated, shape (count,), m."""
    return -0.5 * span * np.cos(np.pi * (np.arange(count) + 0.5) / count)


def induction(span: float, chord: NDArray[np.float64], lift_slope: float) -> NDArray[np.float64]:
    """Return the matrix that gives the induced from the undisturbed normal velocity.

    Parameters
    ----------
    span : float
        m.
    chord : ndarray, shape (strip,)
        m.
    lift_slope : float
        Of the section, per rad.

    Returns
    -------
    ndarray, shape (strip, strip)
        Downwash at each strip over the normal velocity V sin(alpha) at each strip.

    Notes
    -----
    A section's circulation is ``Gamma = c a (w - D Gamma) / 2`` with w the normal velocity and D the
    downwash of the strips' horseshoe vortices; the speed has cancelled, so one constant matrix,
    ``D (I + c a D / 2)^-1 c a / 2``, serves every speed, twist, roll rate and slipstream. Cosine spacing
    gives the elliptic wing's uniform downwash.

    References
    ----------
    Katz, J., and Plotkin, A., *Low-Speed Aerodynamics*, 2nd ed., section 8.1 (lifting line) and 12.1.
    """
    edges, centres = strip_edges(span, len(chord)), strip_centres(span, len(chord))
    trailing = 1 / (centres[:, None] - edges[None, :])
    downwash = (trailing[:, :-1] - trailing[:, 1:]) / (4 * np.pi)
    bound = 0.5 * lift_slope * np.diag(chord)
    return downwash @ np.linalg.solve(np.eye(len(chord)) + bound @ downwash, bound)


def flap_effect(chord_fraction: float) -> tuple[float, float]:
    """Return what a plain flap does by thin-aerofoil theory.

    Parameters
    ----------
    chord_fraction : float
        Flap chord over section chord.

    Returns
    -------
    angle, moment : float
        Change of the zero-lift angle, and of the moment about the quarter chord, per rad of deflection.

    References
    ----------
    Katz, J., and Plotkin, A., *Low-Speed Aerodynamics*, 2nd ed., section 5.4.
    """
    hinge = np.arccos(2 * chord_fraction - 1)
    return 1 - (hinge - np.sin(hinge)) / np.pi, -0.5 * np.sin(hinge) * (1 - np.cos(hinge))


SMALLEST_SPEED = 0.02  # m/s, keeps the flow angle defined in still air


class Section(NamedTuple):
    """An aerofoil section's coefficients, each of shape ().

    Attributes
    ----------
    lift_slope : Array
        Per rad.
    stall : Array
        One minus the cosine of the angle of attack where half the flow has separated.
    drag : Array
        Profile drag at zero lift.
    lift_drag : Array
        Gain of profile drag with the squared sine of the angle from zero lift.
    plate : Array
        Normal-force coefficient at 90 deg.
    moment : Array
        Pitching moment about the quarter chord, attached.
    """

    lift_slope: jax.Array
    stall: jax.Array
    drag: jax.Array
    lift_drag: jax.Array
    plate: jax.Array
    moment: jax.Array


class Wings(NamedTuple):
    """All wings, each with as many strips, from the left tip to the right.

    Attributes
    ----------
    section : Section
    centre : Array, shape (wing, strip, 3)
        Quarter-chord points in wing axes from the tilt axis, m.
    chord : Array, shape (wing, strip)
        m.
    width : Array, shape (wing, strip)
        m.
    induction : Array, shape (wing, strip, strip)
        Of `wing_theory.induction`.
    stall_undisturbed : Array, shape (wing, 1)
        The same of the angle of attack before induction.
    camber : Array, shape (wing, strip)
        Slope of the zero-lift line over the chord, leading edge up, without deflection.
    flap, flap_moment : Array, shape (wing, strip, surface)
        Change of that slope, and of the pitching moment, with each surface's deflection, per rad.
    """

    section: Section
    centre: jax.Array
    chord: jax.Array
    width: jax.Array
    induction: jax.Array
    stall_undisturbed: jax.Array
    camber: jax.Array
    flap: jax.Array
    flap_moment: jax.Array


class Strips(NamedTuple):
    """Loads of all strips.

    Attributes
    ----------
    force : Array, shape (wing, 3)
        Sum over the strips, wing axes, N.
    moment : Array, shape (wing, 3)
        About the tilt axis' origin, wing axes, N m.
    circulation : Array, shape (wing, strip)
        m2/s.
    """

    force: jax.Array
    moment: jax.Array
    circulation: jax.Array


def attachment(cos: jax.Array, stall: jax.Array) -> jax.Array:
    """Return how much of the flow is attached, from 1 at small angles of attack to 0 far beyond stall.

    Parameters
    ----------
    cos : Array
        Of the angle of attack.
    stall : Array
        One minus that cosine where half is attached.

    Returns
    -------
    Array

    Notes
    -----
    One over ``1 + r^3`` with r the ratio of the two, near ``(alpha / alpha_stall)^2``: even, smooth, exactly
    1 at zero and gone in reversed flow, without an arc function or an exponential. It falls as steeply as a
    logistic function whose scale is a sixth of the stall angle.
    """
    ratio = (1 - cos) * (1 / stall)  # a product for each strip is cheaper than a quotient
    return 1 / (1 + ratio**3)


def section_loads(
    section: Section, u: jax.Array, w: jax.Array, slope: jax.Array, flap_moment: jax.Array
) -> tuple[jax.Array, jax.Array, jax.Array, jax.Array]:
    """Return a section's lift, forces and moment for flow from any direction.

    Parameters
    ----------
    section : Section
    u, w : Array
        Velocity relative to the air along the chord and normal to it (down), m/s.
    slope : Array
        Of the zero-lift line over the chord; camber and deflected surfaces raise it.
    flap_moment : Array
        Moment coefficient that deflected surfaces add.

    Returns
    -------
    lift : Array
        Coefficient times speed, m/s; twice the circulation over the chord.
    fx, fz : Array
        Force over ``rho area / 2``, chord axes, m2/s2.
    moment : Array
        About the quarter chord over ``rho area chord / 2``, nose up, m2/s2.

    Notes
    -----
    Only sines and cosines of the flow angle appear, never the angle, so nothing breaks at rest or at
    180 deg; a surface turns the zero-lift line by the arc tangent of its effect, which saturates. The
    separated branch is a normal force ``plate sin / (0.44 + 0.56 |sin|)`` whose point of attack moves from
    the quarter chord to the three-quarter chord as the flow reverses.

    References
    ----------
    Lindenburg, C., "Stall Coefficients", ECN-RX-01-004, 2001, for the shape over the sine; the idea of
    blending attached and flat-plate branches is that of Beard, R. W., and McLain, T. W., *Small Unmanned
    Aircraft*, 2012, eq. 4.9.
    """
    v2 = u**2 + w**2
    speed2 = v2 + SMALLEST_SPEED**2
    per_speed = _per_root(speed2)
    cos, sin, speed = u * per_speed, w * per_speed, speed2 * per_speed
    attached = attachment(cos, section.stall)
    per_length = _per_root(1 + slope**2)
    sin0, cos0 = (sin + cos * slope) * per_length, (cos - sin * slope) * per_length
    normal = (1 - attached) * section.plate * sin0 / (0.44 + 0.56 * jnp.abs(sin0))
    lift = attached * section.lift_slope * sin0 + normal * cos0
    drag = section.drag + attached * section.lift_drag * sin0**2 + normal * sin0
    moment = attached * (section.moment + flap_moment) - normal * 0.25 * (1 - cos)
    fx, fz = v2 * (lift * sin - drag * cos), -v2 * (lift * cos + drag * sin)
    return lift * speed, fx, fz, v2 * moment


def strips(
    wings: Wings,
    velocity: jax.Array,
    rates: jax.Array,
    added: tuple[jax.Array, jax.Array],
    surface: jax.Array,
    rho: jax.Array,
) -> Strips:
    """Return the loads of all wings.

    Parameters
    ----------
    wings : Wings
    velocity, rates : Array, shape (wing, 3)
        Of the wing axes through the air, m/s and rad/s.
    added : tuple of 2 Arrays, shape (wing, strip)
        Velocity relative to the air that slipstreams and wakes add, along the chord and down, m/s.
    surface : Array, shape (surface,)
        rad.
    rho : Array, shape ()
        kg/m3.

    Returns
    -------
    Strips

    Notes
    -----
    The flow angle is taken at three quarters of the chord, the force acts at one quarter (Pistolesi), so
    pitching and tilting are damped. The induced velocity fades with stall.
    """
    p, q, r = (rates[:, i, None] for i in range(3))
    x, y, z = (wings.centre[..., i] for i in range(3))
    u = velocity[:, :1] + q * z - r * y + added[0]
    w = velocity[:, 2:] + p * y - q * (x - 0.5 * wings.chord) + added[1]
    slope = wings.camber + wings.flap @ surface
    cos = u * _per_root(u**2 + w**2 + SMALLEST_SPEED**2)
    attached = attachment(cos, wings.stall_undisturbed)
    normal = (w + u * slope) * _per_root(1 + slope**2)
    induced = jnp.einsum("wij,wj->wi", wings.induction, attached * normal)
    lift, fx, fz, m = section_loads(wings.section, u, w - induced, slope, wings.flap_moment @ surface)
    dynamic = 0.5 * rho * wings.chord * wings.width
    fx, fz, m = dynamic * fx, dynamic * fz, dynamic * wings.chord * m
    moment = jnp.stack([fz * y, fx * z - fz * x + m, -fx * y], axis=-1)
    force = jnp.stack([fx, jnp.zeros_like(fx), fz], axis=-1)
    return Strips(force.sum(axis=1), moment.sum(axis=1), 0.5 * wings.chord * lift)


def _per_root(x: jax.Array) -> jax.Array:
    """Return one over the square root; the compiler would make a slower instruction of the plain form."""
    return jnp.sqrt(x) / x
