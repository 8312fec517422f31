"""Vehicles, motions and manoeuvres that the tests of the wrench and its parts share."""

from types import MappingProxyType

import msgspec
import numpy as np

from freqid.core.channels import si_unit
from freqid.core.errors import DataError
from freqid.core.record import Channel, FlightRecord, Maneuver
from freqid.core.vehicle import Inertia, MassProperties, Rotor, Vehicle, Wing

DT = 0.02
TIME = DT * np.arange(300)
SENSOR = dict.fromkeys(("ax", "ay", "az"), (0.9, 0.3, 0.2))
INERTIA = Inertia(xx=3.1, yy=4.7, zz=6.9, xz=0.45)
RIGID = Vehicle(
    name="rigid",
    mass_properties=MassProperties(mass_kg=12.0, inertia=INERTIA, cg_m=(0.5, 0.0, -0.1)),
    area_m2=1.2,
    span_m=2.9,
    chord_m=0.4,
)
TILTING = msgspec.structs.replace(
    RIGID,
    tilt_rad={"main": 0.4},
    wings=(
        Wing(
            name="main",
            tilt="dw1",
            pivot_m=(0.6, 0.0, -0.2),
            mass_kg=3.0,
            cg_m=(0.9, 0.0, -0.25),
            inertia=Inertia(xx=1.0, yy=0.2, zz=1.1),
        ),
    ),
    rotors=(
        Rotor(name="n1", spin=1, inertia=0.02, axis=(1.0, -0.1, 0.0), wing="main"),
        Rotor(name="n2", spin=-1, inertia=0.03, axis=(1.0, 0.2, 0.1)),
    ),
)


def record(vehicle, positions=MappingProxyType({}), **values):
    """Return a manoeuvre from channels named without their group."""
    channels = {}
    for name, x in values.items():
        group = next((g for g in ("state", "air") if _known(f"{g}/{name}")), "effector")
        full = f"{group}/{name}"
        channels[full] = Channel(
            full, "", np.broadcast_to(x, TIME.shape).astype(float), 50.0, "test", positions.get(name)
        )
    return Maneuver.of(FlightRecord(TIME, channels, vehicle))


def _known(name):
    try:
        return si_unit(name) is not None
    except DataError:
        return False


def motion(seed=1):
    """Return rates that are parabolas, so that a local polynomial differentiates them exactly."""
    rng = np.random.default_rng(seed)
    c = rng.normal(size=(3, 3))
    t = TIME / TIME[-1]
    rates = c @ np.array([np.ones_like(t), t, t**2])
    change = c @ np.array([np.zeros_like(t), np.ones_like(t), 2 * t]) / TIME[-1]
    values = dict(zip("pqr", rates, strict=True))
    values |= {f"a{n}": x for n, x in zip("xyz", rng.normal(size=(3, t.size)), strict=True)}
    return values, rates, change


FULL = motion()[0] | {"dw1": 0.5, "n1": 300.0, "n2": 250.0, "qbar": 80.0, "alpha": 0.1}
