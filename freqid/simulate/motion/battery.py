"""A battery whose voltage sags under load and as it empties."""

from __future__ import annotations

from typing import NamedTuple

import jax
import jax.numpy as jnp

from freqid.core.vehicle import Strict
from freqid.dynamics import precision as precision
from freqid.dynamics.precision import doubles

# Beyond this share of the open-circuit voltage lost inside, no current gives more power: half of it is the
# maximum-power point, so the formula is left a little before.
_DEEPEST_SAG = 0.45


class BatterySection(Strict, frozen=True):
    """``[simulation.actuators.battery]``.

    Attributes
    ----------
    nominal_v : float
        Voltage at which speed commands mean what they say.
    full_v, empty_v : float
        Open-circuit voltage; straight in the charge between them.
    resistance_ohm : float
        Inner resistance with the wiring.
    capacity_ah : float
    efficiency : float
        Shaft power of the motors over electrical power.
    idle_w : float
        What everything else takes.
    charge : float
        State of charge at the start, 0 to 1.
    """

    nominal_v: float
    full_v: float
    empty_v: float
    resistance_ohm: float
    capacity_ah: float
    efficiency: float
    idle_w: float = 0.0
    charge: float = 1.0

    def __post_init__(self) -> None:
        positive = (self.nominal_v, self.empty_v, self.full_v - self.empty_v, self.capacity_ah)
        if not (
            min(positive) > 0
            and self.resistance_ohm >= 0
            and 0 < self.efficiency <= 1
            and self.idle_w >= 0
            and 0 <= self.charge <= 1
        ):
            raise ValueError(
                "expected positive voltages, the full one above the empty one, a positive capacity, an "
                "efficiency and a charge up to 1, a resistance and an idle power that are not negative"
            )


_IDEAL = BatterySection(
    nominal_v=1.0, full_v=1.0 + 1e-12, empty_v=1.0, resistance_ohm=0.0, capacity_ah=1e12, efficiency=1.0
)


class Battery(NamedTuple):
    """A battery; every field of shape ().

    Attributes
    ----------
    nominal, full, empty : Array
        V.
    resistance : Array
        ohm.
    capacity : Array
        A s.
    efficiency : Array
    idle : Array
        W.
    charge : Array
        At the start, 0 to 1.
    """

    nominal: jax.Array
    full: jax.Array
    empty: jax.Array
    resistance: jax.Array
    capacity: jax.Array
    efficiency: jax.Array
    idle: jax.Array
    charge: jax.Array


class Power(NamedTuple):
    """What the battery gives; each of shape ().

    Attributes
    ----------
    voltage : Array
        At the terminals, V.
    current : Array
        A.
    """

    voltage: jax.Array
    current: jax.Array


def battery(section: BatterySection | None) -> Battery:
    """Return the battery of a scenario; one that never sags nor empties where it has none."""
    s = section or _IDEAL
    values = (
        s.nominal_v,
        s.full_v,
        s.empty_v,
        s.resistance_ohm,
        3600 * s.capacity_ah,
        s.efficiency,
        s.idle_w,
        s.charge,
    )
    return doubles(Battery, *values)


def power(battery: Battery, charge: jax.Array, torque: jax.Array, speed: jax.Array) -> Power:
    """Return voltage and current for what the rotors take.

    Parameters
    ----------
    battery : Battery
    charge : Array, shape ()
        State of charge, 0 to 1.
    torque, speed : Array, shape (rotor,)
        N m and rad/s; a windmilling rotor gives nothing back.

    Notes
    -----
    The smaller current that solves ``(E - R I) I = P``. A load beyond what the battery can give holds the
    voltage where it could give most, and the motors slow down.
    """
    open_circuit = battery.empty + (battery.full - battery.empty) * jnp.clip(charge, 0.0, 1.0)
    load = battery.idle + jnp.maximum(torque * speed, 0.0).sum() / battery.efficiency
    root = open_circuit**2 - 4 * battery.resistance * load
    lowest = (1 - 2 * _DEEPEST_SAG) * open_circuit
    voltage = (open_circuit + jnp.sqrt(jnp.maximum(root, lowest**2))) / 2
    return Power(voltage, load / voltage)


def charge_rate(battery: Battery, current: jax.Array) -> jax.Array:
    """Return the rate of change of the state of charge, 1/s."""
    return -current / battery.capacity
