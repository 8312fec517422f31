"""Moments of inertia that are not as described."""

from __future__ import annotations

from collections.abc import Mapping

from msgspec.structs import replace

from freqid.core.vehicle import Vehicle
from freqid.simulate.effects.effect import Effect, Parameter


def _load(settings: Mapping[str, float], vehicle: Vehicle) -> Vehicle:
    """Return the vehicle with its moments of inertia scaled and its product Ixz shifted."""
    stated = vehicle.mass_properties
    old = stated.inertia
    size = (old.xx * old.zz) ** 0.5
    new = replace(
        old,
        xx=(1 + settings["xx"]) * old.xx,
        yy=(1 + settings["yy"]) * old.yy,
        zz=(1 + settings["zz"]) * old.zz,
        xz=old.xz + settings["xz"] * size,
    )
    return replace(vehicle, mass_properties=replace(stated, inertia=new))


EFFECT = Effect(
    id="inertia",
    stage="mass",
    meaning="The vehicle's moments of inertia are not those of its description.",
    parameters={
        "xx": Parameter(
            0.0,
            "1",
            "fraction of the described Ixx that comes on top",
            0.1,
            -0.5,
            1.0,
            signs=(
                "The moment of inertia in roll is larger than it is described",
                "The moment of inertia in roll is smaller than it is described",
            ),
        ),
        "yy": Parameter(
            0.0,
            "1",
            "the same of Iyy",
            0.1,
            -0.5,
            1.0,
            signs=(
                "The moment of inertia in pitch is larger than it is described",
                "The moment of inertia in pitch is smaller than it is described",
            ),
        ),
        "zz": Parameter(
            0.0,
            "1",
            "the same of Izz",
            0.1,
            -0.5,
            1.0,
            signs=(
                "The moment of inertia in yaw is larger than it is described",
                "The moment of inertia in yaw is smaller than it is described",
            ),
        ),
        "xz": Parameter(
            0.0,
            "1",
            "added to Ixz, over the root of Ixx Izz",
            0.03,
            -0.5,
            0.5,
            signs=(
                "The product of inertia Ixz is above what is described",
                "The product of inertia Ixz is below what is described",
            ),
        ),
    },
    load=_load,
)
