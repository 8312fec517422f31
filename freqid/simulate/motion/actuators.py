"""From commands to positions: servos and tilt drives of second order, motors of first order, their limits.

Limits act on the acceleration, so that position, rate and acceleration always belong together, as the
momentum of the wings needs.
"""

from __future__ import annotations

from typing import Any, Literal, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax.typing import ArrayLike

from freqid.core.arrays import Array
from freqid.core.errors import UsageError
from freqid.core.scenario import Scenario
from freqid.core.toml import convert
from freqid.core.vehicle import Effector, Strict, Vehicle
from freqid.dynamics import precision as precision
from freqid.dynamics.precision import doubles
from freqid.simulate.motion.battery import Battery, BatterySection, battery

# A servo meets its stop as if by a bumper of this many times its own frequency, critically damped:
# a motion that starts inside never gets past it, and an ordinary one does not feel it.
STOP = 3.0


class ServoSection(Strict, frozen=True):
    """``[simulation.actuators.surface]`` and ``.tilt``: a closed position loop.

    Attributes
    ----------
    frequency_hz : float
        Undamped natural frequency.
    damping : float
        Ratio.
    delay_s : float
        From the command to its arrival.
    """

    frequency_hz: float
    damping: float
    delay_s: float = 0.0

    def __post_init__(self) -> None:
        if not (self.frequency_hz > 0 and self.damping > 0 and self.delay_s >= 0):
            raise ValueError(
                f"found frequency {self.frequency_hz:g} Hz, damping {self.damping:g} and delay "
                f"{self.delay_s:g} s, expected positive ones and a delay that is not negative"
            )


class MotorSection(Strict, frozen=True):
    """``[simulation.actuators.motor]``: a speed that follows with a time constant up and another down."""

    rise_s: float
    fall_s: float
    delay_s: float = 0.0

    def __post_init__(self) -> None:
        if not (self.rise_s > 0 and self.fall_s > 0 and self.delay_s >= 0):
            raise ValueError(
                f"found time constants {self.rise_s:g} and {self.fall_s:g} s and delay {self.delay_s:g} s, "
                "expected positive ones and a delay that is not negative"
            )


class ActuatorSection(Strict, frozen=True):
    """Section ``[simulation.actuators]``: an entry for each kind of effector that the vehicle has.

    Without a battery the voltage is always the nominal one.
    """

    surface: ServoSection | None = None
    tilt: ServoSection | None = None
    motor: MotorSection | None = None
    battery: BatterySection | None = None

    def of_kind(self, name: Literal["surface", "tilt", "motor"], kind: str, wanted: bool) -> Any:
        """Return an entry, any where the vehicle has no effector of that kind.

        Raises
        ------
        UsageError
            Where it is missing.
        """
        entry = getattr(self, name)
        if entry is None and wanted:
            raise UsageError(
                f"the vehicle has effectors of kind '{kind}', but there is no [simulation.actuators.{name}]",
                remedy="describe how they follow commands",
            )
        return entry or (_NO_MOTOR if name == "motor" else _NO_SERVO)


_NO_SERVO, _NO_MOTOR = ServoSection(frequency_hz=1.0, damping=1.0), MotorSection(rise_s=1.0, fall_s=1.0)


class Servos(NamedTuple):
    """Servos or tilt drives; every field of shape (servo,).

    Attributes
    ----------
    frequency : Array
        Undamped natural frequency, rad/s.
    damping : Array
        Ratio.
    low, high : Array
        Stops, rad.
    rate_limit : Array
        rad/s; infinite where none is stated.
    """

    frequency: jax.Array
    damping: jax.Array
    low: jax.Array
    high: jax.Array
    rate_limit: jax.Array


class Motors(NamedTuple):
    """Motors with their speed controllers; every field of shape (rotor,).

    Attributes
    ----------
    rise, fall : Array
        Time constants, s.
    low, high : Array
        Commands that are obeyed, rad/s.
    rate_limit : Array
        rad/s2.
    """

    rise: jax.Array
    fall: jax.Array
    low: jax.Array
    high: jax.Array
    rate_limit: jax.Array


class Commands(NamedTuple):
    """Commands after excitation, by kind, in the order of the scenario's effectors of that kind.

    Attributes
    ----------
    surface, tilt : Array, shape (surface,) and (wing,)
        rad.
    speed : Array, shape (rotor,)
        At the battery's nominal voltage, rad/s.
    """

    surface: jax.Array
    tilt: jax.Array
    speed: jax.Array


class Actuators(NamedTuple):
    """All actuators of a vehicle.

    Attributes
    ----------
    surface, tilt : Servos
    motor : Motors
    battery : Battery
    delay : Commands of Array, shape ()
        Of the commands of each kind, s.
    """

    surface: Servos
    tilt: Servos
    motor: Motors
    battery: Battery
    delay: Commands


def actuators(scenario: Scenario) -> Actuators:
    """Return the actuators that a scenario describes.

    Raises
    ------
    UsageError
        Where ``[simulation.actuators]`` is incomplete or has unknown keys, with the path.
    """
    section = convert(scenario.simulation.actuators, ActuatorSection, "[simulation.actuators]")
    effectors = scenario.effector
    kinds = {effector.kind for effector in effectors}
    surface = section.of_kind("surface", "surface", "surface" in kinds)
    tilt = section.of_kind("tilt", "tilt", "tilt" in kinds)
    motor = section.of_kind("motor", "rotor", "rotor" in kinds)

    def servos(kind: Literal["surface", "tilt"], described: ServoSection) -> Servos:
        low, high, rate = _limits([e for e in effectors if e.kind == kind])
        frequency = np.full(low.size, 2 * np.pi * described.frequency_hz)
        return doubles(Servos, frequency, np.full(low.size, described.damping), low, high, rate)

    low, high, rate = _limits([e for e in effectors if e.kind == "rotor"])
    rise, fall = (np.full(low.size, t) for t in (motor.rise_s, motor.fall_s))
    delays = (surface.delay_s, tilt.delay_s, motor.delay_s)
    return Actuators(
        surface=servos("surface", surface),
        tilt=servos("tilt", tilt),
        motor=doubles(Motors, rise, fall, low, high, rate),
        battery=battery(section.battery),
        delay=doubles(Commands, *delays),
    )


def by_kind(vehicle: Vehicle, values: ArrayLike) -> Commands:
    """Split commands, shape (..., effector) in the order of the vehicle's effectors, by kind."""
    values = np.asarray(values)
    kinds = [e.kind for e in vehicle.effectors]
    places = ([i for i, k in enumerate(kinds) if k == kind] for kind in ("surface", "tilt", "rotor"))
    parts: list[Any] = [values[..., np.array(p, dtype=int)] for p in places]
    return Commands(*parts)


def servo_acceleration(servos: Servos, position: jax.Array, rate: jax.Array, command: jax.Array) -> jax.Array:
    """Return the acceleration of servos, rad/s2, shape (servo,).

    Parameters
    ----------
    servos : Servos
    position, rate, command : Array, shape (servo,)
        rad, rad/s, rad.

    Notes
    -----
    Inside the limits it is ``w^2 (command - position) - 2 zeta w rate``. The rate that the loop asks for,
    ``w / (2 zeta) (command - position)``, is limited, so the rate approaches its limit and stays below. The
    acceleration towards a stop at distance d is at most ``k^2 d - 2 k rate`` with k = `STOP` w: from
    ``rate <= k d``, which holds at rest, follows ``rate <= k d`` for ever, and d never changes sign.
    """
    frequency, damping = servos.frequency, servos.damping
    aim = jnp.clip(command, servos.low, servos.high)
    asked = jnp.clip(frequency / (2 * damping) * (aim - position), -servos.rate_limit, servos.rate_limit)
    bumper = STOP * frequency
    least = bumper * (bumper * (servos.low - position) - 2 * rate)
    most = bumper * (bumper * (servos.high - position) - 2 * rate)
    return jnp.clip(2 * damping * frequency * (asked - rate), least, most)


def motor_acceleration(motors: Motors, speed: jax.Array, command: jax.Array, ratio: jax.Array) -> jax.Array:
    """Return the acceleration of rotors, rad/s2, shape (rotor,).

    Parameters
    ----------
    motors : Motors
    speed, command : Array, shape (rotor,)
        rad/s.
    ratio : Array, shape ()
        Voltage over nominal voltage. The speed controller sets a share of the voltage, so this scales what
        a command gives and the highest speed alike.
    """
    error = ratio * jnp.clip(command, motors.low, motors.high) - speed
    follow = error / jnp.where(error > 0, motors.rise, motors.fall)
    return jnp.clip(follow, -motors.rate_limit, motors.rate_limit)


def _limits(effectors: list[Effector]) -> tuple[Array, Array, Array]:
    """Return stops and rate limits of effectors, shape (effector,) each."""
    low, high = np.reshape([e.limits for e in effectors], (len(effectors), 2)).T
    rate = [np.inf if e.rate_limit is None else e.rate_limit for e in effectors]
    return low, high, np.array(rate, dtype=float)
