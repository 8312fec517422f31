"""Rotors of the truth in oblique inflow: integrated blade elements, with Glauert's induced velocity."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

SLOPE, PROFILE, SPREAD = 5.7, 0.018, 1.15  # lift slope, profile drag, induced power over the ideal
NEWTON = 2  # steps from a guess; a third changes thrust by less than 5e-4 N in these flights


@dataclass(frozen=True)
class Flow:
    """Flow and loads of every rotor, each of shape (rotor, flight).

    Attributes
    ----------
    thrust, torque : ndarray
        N; N m, against the spin.
    hub : ndarray, shape (3, rotor, flight)
        Velocity across the axis, m/s.
    tip, edge, inflow, through, induced : ndarray
        Tip speed, m/s; advance across the axis and inflow over tip speed; velocity along the axis and induced
        velocity, m/s.
    """

    thrust: np.ndarray
    torque: np.ndarray
    hub: np.ndarray
    tip: np.ndarray
    edge: np.ndarray
    inflow: np.ndarray
    through: np.ndarray
    induced: np.ndarray


class Rotors:
    """All rotors of a vehicle.

    Parameters
    ----------
    names : tuple of str
    described : list of dict
        The scenario's rotors.
    solidity, pitch : ndarray, shape (rotor,)
        Blade area over disc area; pitch of the blades, rad.
    kinds : list of str
        Name of what each rotor's inflow and edgewise flow are scaled by.
    """

    def __init__(self, names, described, solidity, pitch, kinds):
        self.names, self.kinds = names, kinds
        self.axis = np.array([r["axis"] for r in described], dtype=float).T[:, :, None]
        self.place = np.array([r["position_m"] for r in described], dtype=float).T[:, :, None]
        self.spin = np.array([[float(r["spin"])] for r in described])
        self.radius = np.array([[r["diameter_m"] / 2] for r in described])
        self.solidity, self.pitch = solidity[:, None], pitch[:, None]

    def flow(self, x, speeds, rho, s, give=0.0):
        """Return `Flow` of states and speeds.

        Parameters
        ----------
        x : ndarray, shape (state, flight)
        speeds : ndarray, shape (rotor, flight)
        rho : ndarray, shape (flight,)
        s : Settings
        give : ndarray or float
            Share of the pitch that the first two rotors lose.
        """
        u, v, w, p, q, r = x[:6]
        px, py, pz = self.place
        ax, _, az = self.axis  # all of them in the plane of symmetry
        at = u + q * pz - r * py, v + r * px - p * pz, w + p * py - q * px
        through = ax * at[0] + az * at[2]
        hub = np.array([at[0] - ax * through, at[1], at[2] - az * through])
        across = np.sqrt(hub[0] ** 2 + hub[1] ** 2 + hub[2] ** 2)
        if s.has(*(f"{k}." for k in set(self.kinds))):
            through = through * np.array([np.ones(u.size) + s(f"{k}.inflow") for k in self.kinds])
            across = across * np.array([np.ones(u.size) + s(f"{k}.edgewise") for k in self.kinds])
        tip = self.radius * speeds
        edge, climb = across / tip, through / tip
        pitch = self.pitch * np.ones(u.size)
        pitch[:2] -= give * pitch[:2]
        # Thrust coefficient k (pitch (1/3 + edge^2 / 2) - inflow / 2) is 2 induced sqrt(edge^2 + inflow^2).
        k = self.solidity * SLOPE / 2
        lifted = pitch * (1 / 3 + edge**2 / 2)
        induced = 0.02 + 0 * edge
        for _ in range(NEWTON):
            inflow = climb + induced
            total = np.sqrt(edge**2 + inflow**2)
            coefficient = k * (lifted - inflow / 2)
            miss = 2 * induced * total - coefficient
            induced = induced - miss / (2 * total + 2 * induced * inflow / total + k / 2)
        inflow = climb + induced
        coefficient = k * (lifted - inflow / 2)
        drag = self.solidity * PROFILE / 8 * (1 + 4.6 * edge**2)
        turning = coefficient * (climb + SPREAD * induced) + drag
        disc = rho * np.pi * self.radius**2 * tip**2
        each = lambda end: np.array([np.ones(u.size) + s(f"{n}.{end}") for n in self.names])  # noqa: E731
        power, twist = disc, disc * self.radius
        if s.has(*(f"{n}." for n in self.names)):
            power, twist = power * each("thrust"), twist * each("torque")
        if s.has("weak_rotor"):
            power = power - disc * s.of_all("weak_rotor.loss", self.names)
        return Flow(power * coefficient, twist * turning, hub, tip, edge, inflow, through, induced * tip)

    def wake(self, flow, rho):
        """Return the velocity that each rotor adds far behind it, m/s: thrust over mass flow."""
        thrust = np.maximum(flow.thrust, 0.0)
        total = np.sqrt((flow.edge * flow.tip) ** 2 + (flow.inflow * flow.tip) ** 2)
        return thrust / (rho * np.pi * self.radius**2 * total)

    def in_plane(self, flow, rho, strength):
        """Return force and moment, shape (3, flight), of blades that meet more and less flow in turn.

        A rotor without flapping is dragged across its axis, and thrusts more on the side that advances.
        """
        disc = strength * rho * np.pi * self.radius**2 * flow.tip**2
        dragged = self.solidity * flow.edge * (PROFILE / 4 + SLOPE / 4 * self.pitch * flow.inflow)
        rolled = self.solidity * SLOPE / 2 * flow.edge * (self.pitch / 3 - flow.inflow / 4)
        way = flow.hub / np.maximum(np.sqrt((flow.hub**2).sum(axis=0)), 1e-3)
        force = -way * (disc * dragged)
        # The spin says which side advances; more thrust there turns the vehicle about the way it goes.
        moment = np.cross(self.place, force, axis=0) - way * (self.spin * disc * self.radius * rolled)
        return force.sum(axis=1), moment.sum(axis=1)
