"""A tilt-wing aircraft made of point masses, moved in inertial axes by closed formulas of time.

It shares no equation with the package: accelerations of the points come from second-order Taylor
arithmetic, force and moment are plain sums over the points, and the mass properties that it states are
sums over the same points.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np

from freqid.core.channels import si_unit
from freqid.core.record import Channel, FlightRecord, Maneuver
from freqid.core.vehicle import Inertia, MassProperties, Rotor, Vehicle, Wing

GRAVITY = np.array([0.0, 0.0, 9.80665])


@dataclass
class Jet:
    """A function of time by its value and its first two derivatives, each of shape (..., sample)."""

    v: np.ndarray
    d: np.ndarray
    dd: np.ndarray

    def __add__(self, other):
        if not isinstance(other, Jet):
            return Jet(self.v + other, self.d, self.dd)
        return Jet(self.v + other.v, self.d + other.d, self.dd + other.dd)

    def __mul__(self, other):
        if not isinstance(other, Jet):
            return Jet(self.v * other, self.d * other, self.dd * other)
        return Jet(
            self.v * other.v,
            self.d * other.v + self.v * other.d,
            self.dd * other.v + 2 * self.d * other.d + self.v * other.dd,
        )

    __radd__, __rmul__ = __add__, __mul__

    def __neg__(self):
        return self * -1.0


def sin(x):
    s, c = np.sin(x.v), np.cos(x.v)
    return Jet(s, c * x.d, c * x.dd - s * x.d**2)


def cos(x):
    s, c = np.sin(x.v), np.cos(x.v)
    return Jet(c, -s * x.d, -s * x.dd - c * x.d**2)


def clock(time):
    return Jet(time, np.ones_like(time), np.zeros_like(time))


def cloud(rng, count, centre, size):
    return rng.uniform(0.5, 2.0, count), np.asarray(centre)[:, None] + size * rng.uniform(-1, 1, (3, count))


def properties(masses, places):
    """Return mass, centre and inertia of point masses, by the definitions."""
    mass = masses.sum()
    centre = places @ masses / mass
    x, y, z = places - centre[:, None]
    return (
        mass,
        tuple(centre),
        Inertia(
            xx=masses @ (y**2 + z**2),
            yy=masses @ (x**2 + z**2),
            zz=masses @ (x**2 + y**2),
            xz=masses @ (x * z),
            xy=masses @ (x * y),
            yz=masses @ (y * z),
        ),
    )


def tilted(places, pivot, angle):
    """Return points turned leading edge up about an axis along y, by a textbook matrix."""
    c, s = np.cos(angle), np.sin(angle)
    turn = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
    return pivot[:, None] + turn @ (places - pivot[:, None])


class TiltWingAircraft:
    """Fuselage, two wings that tilt, four rotors on each: 9 + 2 (6 + 4 x 4) point masses."""

    tilt_stated: ClassVar = {"front": 0.35, "rear": -0.1}

    def __init__(self, time, *, spinning=True, tilting=True):
        rng = np.random.default_rng(7)
        t = clock(time)
        self.time = time
        # Attitude and path in inertial axes: nothing periodic, nothing small.
        phi = 0.5 * sin(1.3 * t + 0.4) + 0.08 * t
        theta = 0.4 * sin(0.9 * t + 1.1) + 0.1 * sin(2.3 * t)
        psi = 0.7 * sin(0.6 * t) + 0.15 * t
        self.path = [30.0 * t + 4.0 * sin(1.1 * t), 3.0 * sin(0.8 * t + 0.3), 2.0 * cos(1.4 * t) + -1.5 * t]
        self.attitude = euler(phi, theta, psi)

        places = {"body": cloud(rng, 9, (0.3, 0.1, 0.2), 1.5)}
        self.points = [self._fixed(*places["body"])]
        self.tilts, self.speeds, self.wings, self.rotors = {}, {}, [], []
        for k, (name, x) in enumerate((("front", 0.9), ("rear", -1.6))):
            pivot = np.array([x, 0.0, -0.2])
            stated = self.tilt_stated[name]
            moving = 0.7 + 0.25 * sin((1.2 + 0.3 * k) * t + k) + (0.06 - 0.15 * k) * t
            tilt = moving if tilting else moving * 0.0 + stated
            self.tilts[f"dw{k + 1}"] = tilt
            wing = cloud(rng, 6, np.add(pivot, (0.25, 0.05, -0.1)), 0.6)
            self.points.append(self._on_wing(*wing, pivot, tilt))
            pieces = [wing]
            for side in range(4):
                rotor = f"n{4 * k + side + 1}"
                hub = np.add(pivot, (0.5, (-1.8, -0.9, 0.9, 1.8)[side], 0.05 * side))
                axis = np.array([1.0, 0.06 * (side - 1.5), -0.1 + 0.03 * side])
                spin = 1 if (side + k) % 2 else -1
                pieces.append(
                    self._add_rotor(
                        rotor, spin, axis, hub, 0.08 + 0.01 * side, pivot, tilt, name, t, spinning
                    )
                )
            mass, centre, inertia = properties(
                np.concatenate([m for m, _ in pieces]), np.concatenate([p for _, p in pieces], axis=1)
            )
            self.wings.append(
                Wing(
                    name=name,
                    tilt=f"dw{k + 1}",
                    pivot_m=tuple(pivot),
                    mass_kg=mass,
                    cg_m=centre,
                    inertia=inertia,
                )
            )
            places[name] = (
                np.concatenate([m for m, _ in pieces]),
                tilted(np.concatenate([p for _, p in pieces], axis=1), pivot, stated),
            )
        mass, centre, inertia = properties(
            np.concatenate([m for m, _ in places.values()]),
            np.concatenate([p for _, p in places.values()], axis=1),
        )
        self.vehicle = Vehicle(
            name="point masses",
            mass_properties=MassProperties(mass_kg=mass, cg_m=centre, inertia=inertia),
            tilt_rad=self.tilt_stated,
            area_m2=1.7,
            span_m=3.9,
            chord_m=0.4,
            rotors=tuple(self.rotors),
            wings=tuple(self.wings),
        )

    def _add_rotor(self, name, spin, axis, hub, mass, pivot, tilt, wing, t, spinning):
        """Four equal masses on a ring, turning at their own changing speed."""
        number, radius = int(name[1:]), 0.3
        rate = 0.4 + 0.1 * number
        angle = 350.0 * t + (12.0 * t) * t + -(60.0 / rate) * cos(rate * t + number)
        angle = angle if spinning else angle * 0.0
        self.speeds[name] = angle.d
        e = axis / np.linalg.norm(axis)
        u = np.linalg.svd(e[None])[2][1]
        v = np.cross(e, u)
        masses = np.full(4, mass)
        c, s = cos(angle) * radius, sin(angle) * radius
        for along, across in ((c, s), (-s, c), (-c, -s), (s, -c)):  # a quarter turn apart, exactly
            local = [along * u[i] + across * (spin * v[i]) + hub[i] for i in range(3)]
            self.points.append((masses[:1, None], self._inertial(self._turned(local, pivot, tilt))))
        self.rotors.append(
            Rotor(
                name=name,
                spin=spin,
                inertia=4 * mass * radius**2,
                axis=tuple(axis),
                position_m=tuple(hub),
                wing=wing,
            )
        )
        quarter = np.arange(4) * np.pi / 2
        return masses, hub[:, None] + radius * (np.outer(u, np.cos(quarter)) + np.outer(v, np.sin(quarter)))

    def _fixed(self, masses, places):
        zero = np.zeros_like(self.time)
        return masses[:, None], self._inertial([Jet(p[:, None] + zero, zero, zero) for p in places])

    def _on_wing(self, masses, places, pivot, tilt):
        zero = np.zeros_like(self.time)
        local = [Jet(p[:, None] + zero, zero, zero) for p in places]
        return masses[:, None], self._inertial(self._turned(local, pivot, tilt))

    def _turned(self, local, pivot, tilt):
        x, y, z = local[0] + -pivot[0], local[1], local[2] + -pivot[2]
        c, s = cos(tilt), sin(tilt)
        return [c * x + s * z + pivot[0], y, c * z + -(s * x) + pivot[2]]

    def _inertial(self, local):
        a = self.attitude
        return [self.path[i] + a[i][0] * local[0] + a[i][1] * local[1] + a[i][2] * local[2] for i in range(3)]

    @cached_property
    def _columns(self):
        return np.array([[self.attitude[i][j].v for j in range(3)] for i in range(3)])

    def to_body(self, vector):
        return np.einsum("ijt,i...t->j...t", self._columns, vector)

    @cached_property
    def rates(self):
        """Angular velocity from the skew matrix A' dA/dt, shape (3, sample)."""
        change = np.array([[self.attitude[i][j].d for j in range(3)] for i in range(3)])
        skew = np.einsum("ijt,ikt->jkt", self._columns, change)
        return np.array([skew[2, 1], skew[0, 2], skew[1, 0]])

    @cached_property
    def acceleration(self):
        """Angular acceleration from the second derivative: the skew part of A' d2A/dt2."""
        change = np.array([[self.attitude[i][j].dd for j in range(3)] for i in range(3)])
        skew = np.einsum("ijt,ikt->jkt", self._columns, change)
        return 0.5 * np.array([skew[2, 1] - skew[1, 2], skew[0, 2] - skew[2, 0], skew[1, 0] - skew[0, 1]])

    def specific_force(self, position):
        """What a perfect accelerometer fixed at a place of the body reads, shape (3, sample)."""
        zero = np.zeros_like(self.time)
        inertial = self._inertial([Jet(zero + p, zero, zero) for p in position])
        return self.to_body(np.array([x.dd for x in inertial]) - GRAVITY[:, None])

    def force_and_moment(self):
        """Newton, point by point: what must act from outside, body axes, shape (6, sample)."""
        masses = np.concatenate([np.broadcast_to(m, (len(m), 1)) for m, _ in self.points])
        places, pulls = (
            np.stack(
                [
                    np.concatenate([np.atleast_2d(getattr(p[i], part)) for _, p in self.points])
                    for i in range(3)
                ]
            )
            for part in ("v", "dd")
        )
        pulls = masses * (pulls - GRAVITY[:, None, None])
        centre = (masses * places).sum(axis=1) / masses.sum()
        moment = np.cross(places - centre[:, None], pulls, axis=0).sum(axis=1)
        return np.concatenate((self.to_body(pulls.sum(axis=1)), self.to_body(moment)))

    def maneuver(self, sensors=((0.4, -0.2, 0.3),) * 3):
        values = {f"state/{n}": x for n, x in zip("pqr", self.rates, strict=True)}
        values |= {f"state/{n}dot": x for n, x in zip("pqr", self.acceleration, strict=True)}
        values |= {f"effector/{n}": x.v for n, x in self.tilts.items()}
        values |= {f"effector/{n}": x for n, x in self.speeds.items()}
        values["air/qbar"] = 300.0 + 120.0 * np.sin(0.7 * self.time)
        values["air/alpha"] = 0.2 + 0.1 * np.sin(self.time)
        positions = {}
        for i, (name, place) in enumerate(zip("xyz", sensors, strict=True)):
            values[f"state/a{name}"] = self.specific_force(place)[i]
            positions[f"state/a{name}"] = place
        channels = {
            n: Channel(n, si_unit(n) or "", np.array(x), 250.0, "oracle", positions.get(n))
            for n, x in values.items()
        }
        return Maneuver.of(FlightRecord(self.time, channels, self.vehicle))


def euler(phi, theta, psi):
    """Return the matrix from body to inertial axes (yaw, pitch, roll), entries as jets."""
    cf, sf, ct, st, cp, sp = cos(phi), sin(phi), cos(theta), sin(theta), cos(psi), sin(psi)
    return [
        [ct * cp, sf * st * cp + -(cf * sp), cf * st * cp + sf * sp],
        [ct * sp, sf * st * sp + cf * cp, cf * st * sp + -(sf * cp)],
        [-st, sf * ct, cf * ct],
    ]
