"""Total-energy control: rotors hold the rate of energy, pitch shares it between speed and climb.

With specific energy rate ``e = gamma + V' / g`` and balance ``d = gamma - V' / g``, the rotors' common speed
follows the error of e and the commanded pitch that of d, each proportional and integral; the speed error is
made an acceleration that is asked for. With stopped rotors only the speed counts in d, and the climb angle
is what the glide makes of it. While a manoeuvre is flown the rotors hold their advance ratio, so that their
speed goes with the airspeed, and only the speed counts in d too. Inner loops hold pitch, wings level and
heading, with gains that go down with the dynamic pressure.

References
----------
A. A. Lambregts, "Vertical Flight Path and Speed Control Autopilot Design Using Total Energy Principles",
AIAA 83-2239, 1983.
"""

from __future__ import annotations

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from freqid.core.errors import UsageError, nearest
from freqid.core.scenario import Scenario
from freqid.core.toml import convert
from freqid.core.units import STANDARD_GRAVITY
from freqid.core.vehicle import Strict
from freqid.dynamics.precision import doubles
from freqid.simulate.control.trim import Trim
from freqid.simulate.motion import attitude
from freqid.simulate.motion.actuators import Actuators, Commands
from freqid.simulate.motion.rigid_body import BodyState

_SLOWEST = 1.0  # m/s, keeps the climb angle defined


class TecsSection(Strict, frozen=True):
    """Section ``[control.tecs]``.

    Attributes
    ----------
    pitch, roll, yaw : dict
        By surface: what it moves for one rad of nose-up, right-wing-down or nose-right demand, rad.
    speed : float
        Acceleration that is asked for by speed error, 1/s.
    acceleration : float
        That is asked for at most, m/s2.
    energy : float
        Rotor speed by energy rate, rad/s per rad.
    balance : float
        Commanded pitch by balance, rad per rad.
    integral : float
        Of both, over their proportional parts, 1/s.
    theta, q : float
        Pitch demand by pitch error and pitch rate, at the speed of the start; rad per rad and per rad/s.
    phi, p : float
        The same of roll.
    r : float
        Yaw demand by yaw rate.
    heading : float
        Commanded bank by heading error.
    bank_rad : float
        Commanded bank at most.
    pitch_rad : tuple of 2 floats
        Commanded pitch, lowest and highest.
    filter_s : float
        Time constant of the measured acceleration.
    """

    pitch: dict[str, float]
    roll: dict[str, float]
    yaw: dict[str, float]
    speed: float = 0.3
    acceleration: float = 1.5
    energy: float = 500.0
    balance: float = 0.6
    integral: float = 0.5
    theta: float = 1.0
    q: float = 0.15
    phi: float = 0.6
    p: float = 0.05
    r: float = 0.1
    heading: float = 0.6
    bank_rad: float = 0.35
    pitch_rad: tuple[float, float] = (-0.35, 0.6)
    filter_s: float = 0.4


class Goal(NamedTuple):
    """What is to be held at one instant; the counterpart of `law.Aim`.

    Attributes
    ----------
    speed : Array, shape ()
        Airspeed, m/s.
    climb : Array, shape ()
        Flight path angle, rad.
    stopped : Array, shape ()
        One where the rotors are stopped, else zero.
    held : Array, shape ()
        One while a manoeuvre is flown, else zero.
    wind : Array, shape (3,)
        Mean wind, north, east, down, m/s.
    """

    speed: jax.Array
    climb: jax.Array
    stopped: jax.Array
    held: jax.Array
    wind: jax.Array


class Tecs(NamedTuple):
    """The controller; gains as in `TecsSection`.

    Attributes
    ----------
    gains : dict of Array, shape ()
    surface : Array, shape (surface, 3)
        Moves for pitch, roll and yaw demands.
    trim : Commands
        At the start.
    pitch : Array, shape ()
        Of the start, rad.
    speed : Array, shape ()
        Of the start, m/s.
    low, high : Commands
    bounds : Array, shape (2,)
        Of the commanded pitch, rad.
    """

    gains: dict[str, jax.Array]
    surface: jax.Array
    trim: Commands
    pitch: jax.Array
    speed: jax.Array
    low: Commands
    high: Commands
    bounds: jax.Array

    @property
    def memory(self) -> jax.Array:
        """Integrals of energy and balance, filtered speed, rotor speed over airspeed; shape (4,)."""
        zero = jnp.zeros_like(self.pitch)
        rotor = self.trim.speed.mean(axis=-1)
        return jnp.stack([zero, zero, self.speed, rotor / self.speed], axis=-1)

    def command(self, body: BodyState, memory: jax.Array, aim: Goal) -> tuple[Commands, jax.Array]:
        """Return commands and the rate of change of the memory."""
        g = self.gains
        energy_sum, balance_sum, filtered, ratio = memory
        motion = attitude.to_ground(body.attitude, body.velocity) - aim.wind
        speed = jnp.maximum(jnp.sqrt((motion**2).sum()), _SLOWEST)
        climb = jnp.arcsin(-motion[2] / speed)
        phi, theta, psi = attitude.euler(body.attitude)
        p, q, r = body.rates

        gaining = (speed - filtered) / g["filter_s"] / STANDARD_GRAVITY
        most = g["acceleration"] / STANDARD_GRAVITY
        wanted = jnp.clip(g["speed"] * (aim.speed - speed) / STANDARD_GRAVITY, -most, most)
        energy = aim.climb - climb + wanted - gaining
        alone = jnp.maximum(aim.stopped, aim.held)  # pitch holds the speed and nothing else
        balance = (1 - alone) * (aim.climb - climb) - (1 + alone) * (wanted - gaining)

        asked = self.trim.speed.mean() + g["energy"] * (energy + g["integral"] * energy_sum)
        rotor = jnp.clip(asked, self.low.speed.min(), self.high.speed.max())
        tilted = self.pitch + g["balance"] * (balance + g["integral"] * balance_sum)
        pitch = jnp.clip(tilted, self.bounds[0], self.bounds[1])
        # An integral that has driven its output to a limit waits there.
        rates = jnp.stack(
            [
                (1 - alone) * energy * ((asked == rotor) | (energy * asked < energy * rotor)),
                balance * ((tilted == pitch) | (balance * tilted < balance * pitch)),
                (speed - filtered) / g["filter_s"],
                (1 - aim.held) * (rotor / speed - ratio),
            ]
        )
        rotor = jnp.where(aim.held > 0, ratio * speed, rotor) * (1 - aim.stopped)

        bank = jnp.clip(-g["heading"] * psi, -g["bank_rad"], g["bank_rad"])
        demand = jnp.stack(
            [
                g["theta"] * (pitch - theta) - g["q"] * q,
                g["phi"] * (bank - phi) - g["p"] * p,
                -g["r"] * r,
            ]
        )
        surface = self.trim.surface + self.surface @ demand * (self.speed / speed) ** 2
        commands = Commands(surface, self.trim.tilt, rotor * jnp.ones_like(self.trim.speed))
        return jax.tree.map(jnp.clip, commands, self.low, self.high), rates


def tecs(scenario: Scenario, actuators: Actuators, start: Trim) -> Tecs:
    """Return the controller that takes over at a trim.

    Raises
    ------
    UsageError
        Where ``[control.tecs]`` is missing or names a surface that the vehicle does not have, or there is no
        rotor.
    """
    if "tecs" not in scenario.control:
        raise UsageError("the scenario has no [control.tecs]", remedy="state the gains that fly the campaign")
    section = convert(scenario.control["tecs"], TecsSection, "[control.tecs]")
    surfaces = [e.name for e in scenario.effector if e.kind == "surface"]
    moves = np.zeros((len(surfaces), 3))
    for axis, name in enumerate(("pitch", "roll", "yaw")):
        for surface, share in getattr(section, name).items():
            if surface not in surfaces:
                raise UsageError(
                    f"[control.tecs] {name} names surface '{surface}'", remedy=nearest(surface, surfaces)
                )
            moves[surfaces.index(surface), axis] = share
    if not actuators.motor.high.size:
        raise UsageError("the vehicle has no rotor that holds its energy", remedy="add a [[rotor]]")
    plain = [name for name in section.__struct_fields__ if isinstance(getattr(section, name), int | float)]
    return doubles(
        Tecs,
        gains={name: getattr(section, name) for name in plain},
        surface=moves,
        trim=start.commands,
        pitch=start.angles[1],
        speed=np.linalg.norm(start.body.velocity),
        low=Commands(actuators.surface.low, actuators.tilt.low, actuators.motor.low),
        high=Commands(actuators.surface.high, actuators.tilt.high, actuators.motor.high),
        bounds=list(section.pitch_rad),
    )
