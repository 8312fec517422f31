"""JSBSim's c172p of the open cases: edited copies of itself, flown at 200 Hz, a little off everywhere."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from bench import DURATION, Bench, Circumstances
from c172p_craft import RATE_HZ, Craft
from c172p_flight import excitation, fly
from c172p_truths import Edited, find
from gap_c172p import KINDS, NOISE
from truth import Part

from freqid.core.channels import si_unit
from freqid.core.record import Channel, FlightRecord
from freqid.gap.connect.jsbsim import load

SPEEDS = {"v29": 29.0, "v48": 48.0}  # m/s
_AT = tuple(SPEEDS)
STEPS_OF = {  # of sensors in coarse cases
    **dict.fromkeys(("state/u", "state/v", "state/w"), 0.1),
    **dict.fromkeys(("state/phi", "state/theta", "state/psi"), np.radians(0.1)),
    **dict.fromkeys(("state/ax", "state/ay", "state/az"), 0.02),
    **dict.fromkeys(("effector/elevator", "effector/aileron", "effector/rudder"), np.radians(0.1)),
}
JITTER = 0.002  # s, of the moments at which they are read in coarse cases
SIMULATION = load("c172p")


def scattered(seed: int) -> Craft:
    """Return the aircraft with every coefficient, its propeller and its masses a little off."""
    rng = np.random.default_rng([seed, 11])

    def off(sigma: float) -> float:
        return float(sigma * np.clip(rng.standard_normal(), -2, 2))

    craft = Craft.nominal()
    for name in craft.coefficients:
        craft.times(name, 1 + off(0.05))
    for table in craft.propeller.findall("table"):
        factor, data = 1 + off(0.03), table.find("tableData")
        assert data is not None
        pairs = (line.split() for line in (data.text or "").strip().splitlines())
        data.text = "\n".join(f"{a} {factor * float(c)}" for a, c in pairs)
    craft.ballast(off(0.01) * craft.weighed().weight)
    craft.shift([off(0.005) for _ in range(3)])
    craft.turn_harder({axis: off(0.03) for axis in ("xx", "yy", "zz")})
    return craft


def flown(at: str, parts: Sequence[Part], how: Circumstances) -> FlightRecord:
    """Fly one manoeuvre of a case and return its log, which describes the nominal vehicle.

    Sensors of every third case have coarse digits and are read at jittering moments.
    """
    craft = scattered(how.scatter) if how.scatter is not None else Craft.nominal()
    for part in parts:
        if isinstance(part.truth, Edited):
            craft = part.truth.craft(craft, part.size, part.place)
    time = np.arange(round(RATE_HZ * DURATION)) / RATE_HZ
    injected = excitation(time.size, 20 + 10 * how.signals + _AT.index(at))
    values = fly(craft, SPEEDS[at], injected, gusts=how.gusts, seed=how.seed)
    units = {n: "1" if n.startswith(("command", "excitation")) else si_unit(n, KINDS) or "1" for n in values}
    channels = {n: Channel(n, units[n], x, RATE_HZ, "JSBSim") for n, x in values.items()}
    record = FlightRecord(time, channels, vehicle=SIMULATION.vehicle)
    for part in parts:
        record = part.truth.record(record, part.size, part.place)
    coarse = how.scatter is not None and how.scatter % 3 == 1
    return _read(record, how.noise, how.seed, coarse) if how.noise else record


def _read(record: FlightRecord, noise: float, seed: int, coarse: bool) -> FlightRecord:
    rng = np.random.default_rng([seed, 1])
    found = []
    for name, sigma in NOISE.items():
        values = record[name]
        if coarse and name.startswith("state/"):
            values = values + JITTER * rng.standard_normal(values.size) * np.gradient(values, record.dt)
        values = values + noise * sigma * rng.standard_normal(values.size)
        if coarse and name in STEPS_OF:
            values = STEPS_OF[name] * np.round(values / STEPS_OF[name])
        found.append(replace(record.channel(name), values=values))
    return record.with_channels(*found)


C172P = Bench(name="c172p", at=_AT, simulation=SIMULATION, fly=flown, find=find)
