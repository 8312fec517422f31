"""A wing twice: as four strips in their own flow (the truth), and as coefficients (the owner)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Wing:
    """Geometry and polar that both share.

    Attributes
    ----------
    area, chord, y_inner, y_outer, outer_share : float
        m2, m, spanwise stations of the strips in m, share of the area of each outer strip.
    slope, zero, dihedral : float
        Lift slope, angle of zero lift and dihedral, rad.
    drag, induced, quartic : float
        The truth's polar: at zero lift, with the square and the fourth power of lift.
    owner_drag, owner_induced : float
        The owner's polar, without a fourth power.
    aileron, moment, centre : float
        Lift of an outer strip per rad, moment coefficient, aerodynamic centre ahead of the origin, m.
    flap : float
        Lift of an inner strip per rad, where the wing has flaperons.
    """

    area: float
    chord: float
    y_inner: float
    y_outer: float
    outer_share: float
    slope: float
    zero: float
    dihedral: float
    drag: float
    induced: float
    quartic: float
    owner_drag: float
    owner_induced: float
    aileron: float
    moment: float
    centre: float
    flap: float = 0.0

    @property
    def y2(self) -> float:
        """Mean square of the span stations, m2."""
        return 2 * (self.outer_share * self.y_outer**2 + (0.5 - self.outer_share) * self.y_inner**2)

    @property
    def y1(self) -> float:
        """Mean distance of the strips from the middle, m."""
        return 2 * (self.outer_share * self.y_outer + (0.5 - self.outer_share) * self.y_inner)


def strip_loads(g, x, ailerons, half, s, memory, blown=None, flaps=None):
    """Return X Z L M N of the wing as strips, in the truth.

    Parameters
    ----------
    g : Wing
    x : ndarray, shape (state, flight)
    ailerons : tuple of 2 ndarray
    half : ndarray
        Half the air density.
    s : Settings
    memory : object
        Has the lagged angle of attack, `alpha`.
    blown : ndarray, shape (2, 4, flight), optional
        Velocity that propellers add over each strip, from left to right, along x and z, m/s.
    flaps : tuple of 2 ndarray, optional
        Left and right flaperon, of the inner strips.
    """
    u, v, w, p, _, r = x[:6]
    station = np.array([-g.y_outer, -g.y_inner, g.y_inner, g.y_outer])[:, None]
    share = np.array([g.outer_share, 0.5 - g.outer_share, 0.5 - g.outer_share, g.outer_share])[:, None]
    bent = g.dihedral * (1 + s("wing.dihedral"))
    ui = u - r * station
    wi = w + p * station * (1 + s("wing.roll_damping")) + v * bent * np.sign(station)
    if blown is not None:
        ui, wi = ui + blown[0], wi + blown[1]
    vi2 = ui * ui + wi * wi
    inv = 1 / np.sqrt(vi2)
    sa, ca = wi * inv, ui * inv
    s1 = sa * np.cos(g.zero) - ca * np.sin(g.zero)
    c1 = ca * np.cos(g.zero) + sa * np.sin(g.zero)
    slope = g.slope * (1 + s("wing.lift_slope"))
    lift = slope * s1 * c1 - g.slope * g.zero * s("wing.lift_zero")
    if s.has("stall"):  # separation creeps forward over each strip
        apart = 1 - np.exp(-((np.maximum(s1 - 0.04, 0) / 0.10) ** 2))
        lift = lift * (1 - s("stall.strength") * apart * (1 - 0.25 * s1))
    if s.has("unsteady_lift"):
        acts = np.asarray(s("unsteady_lift.time_constant")) > 0
        lift = lift + slope * (memory.alpha - np.arctan2(w, u)) * np.where(acts, 0.94, 0)
    moved = [(0, "ail_l", g.aileron, ailerons[0]), (3, "ail_r", g.aileron, ailerons[1])]
    if flaps is not None:
        moved += [(1, "flap_l", g.flap, flaps[0]), (2, "flap_r", g.flap, flaps[1])]
    for i, name, effect, angle in moved:
        lift[i] += effect * (1 + s(f"{name}.effectiveness")) * angle * (1 - 0.25 * angle**2)
    drag = g.drag * (1 + s("wing.drag_zero")) + g.induced * (1 + s("wing.drag_induced")) * lift**2
    drag = drag + g.quartic * lift**4
    qi = half * vi2 * (g.area * share)
    xi, zi = qi * (lift * sa - drag * ca), -qi * (lift * ca + drag * sa)
    X, Z = xi.sum(axis=0), zi.sum(axis=0)
    M = half * (u * u + v * v + w * w) * g.area * g.chord * g.moment * (1 + s("wing.moment")) + g.centre * Z
    return X, Z, (station * zi).sum(axis=0), M, -(station * xi).sum(axis=0)


def coefficient_loads(m, g, flow, rates, ailerons, rho, get, flaps=None):
    """Return X Z L M N of the wing, as the owner has them.

    Parameters
    ----------
    m : module
        `math` or `numpy`.
    g : Wing
    flow : tuple
        u v w, airspeed, sine and cosine of the angle of attack, and that angle.
    rates : tuple
        p and r.
    ailerons : tuple
        Left and right, rad.
    rho : float or ndarray
    get : callable
        Departures of the owner's parameters by name.
    flaps : tuple, optional
        Left and right flaperon, rad.
    """
    u, v, w, speed, sa, ca, alpha = flow
    p, r = rates
    qs = 0.5 * rho * (u * u + w * w) * g.area
    at = alpha - g.zero
    slope = g.slope * (1 + get("wing.lift_slope", 0.0))
    cl = slope * at * (1 - 0.664 * at * at) - g.slope * g.zero * get("wing.lift_zero", 0.0)
    cla = slope * (1 - 1.98 * at * at)
    pairs = [_pair("ail", g.outer_share, g.y_outer, g.aileron, ailerons, get)]
    if flaps is not None:
        pairs.append(_pair("flap", 0.5 - g.outer_share, g.y_inner, g.flap, flaps, get))
    kd = g.owner_induced * (1 + get("wing.drag_induced", 0.0))
    cd = g.owner_drag * (1 + get("wing.drag_zero", 0.0)) + kd * cl * cl
    lift, drag = cl, cd
    for share, _, dl, dd in pairs:
        lift = lift + share * (dl + dd)
        drag = drag + kd * share * (2 * cl * (dl + dd) + dl * dl + dd * dd)
    cda = 2 * kd * cl * cla
    X = qs * (lift * sa - drag * ca)
    Z = -qs * (lift * ca + drag * sa)
    pd = p * (1 + get("wing.roll_damping", 0.0))
    bent = g.dihedral * (1 + get("wing.dihedral", 0.0))
    tilt = ((ca * pd + sa * r) * g.y2 + ca * v * bent * g.y1) / speed
    more = 2 * ((pd * sa - r * ca) * g.y2 + sa * v * bent * g.y1) / speed
    L = -qs * (((cla + cd) * ca + (cda - cl) * sa) * tilt + (cl * ca + cd * sa) * more)
    N = -qs * (((cla + cd) * sa + (cl - cda) * ca) * tilt + (cl * sa - cd * ca) * more)
    Z = Z + 0.5 * g.slope * g.area * g.y2 * rho * p * r
    for share, y, dl, dd in pairs:
        steer = qs * share * y
        turned = (y * (pd * ca + r * sa) + g.dihedral * v * ca) / speed
        quicker = 2 * y * r * ca / speed
        Z = Z - qs * share * quicker * (dl - dd)
        L = L + steer * (dl - dd + (dl + dd) * quicker) * (ca + 2 * kd * cl * sa)
        N = N + steer * ((dl - dd) * (sa - 2 * kd * cl * ca) - kd * ca * (dl * dl - dd * dd))
        N = N + steer * (dl + dd) * ca * turned * (2 * kd * cla - 1)
    M = g.centre * Z + 0.5 * rho * speed * speed * g.area * g.chord * g.moment * (1 + get("wing.moment", 0.0))
    return X, Z, L, M, N


def _pair(name, share, y, effect, angles, get):
    """Return share of the area, station, and lift that each of two surfaces adds to its strip."""
    left, right = (
        effect * (1 + get(f"{name}_{end}.effectiveness", 0.0)) * angle
        for end, angle in zip("lr", angles, strict=True)
    )
    return share, y, left, right
