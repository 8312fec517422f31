"""The log that a record would be without an effect of sensors or of the air."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from freqid.core.record import FlightRecord
from freqid.simulate.effects.effect import Effect

_ROUNDS = 4  # in which a log without an effect is found from one with it


def without(effect: Effect, settings: Mapping[str, float], record: FlightRecord) -> FlightRecord:
    """Return the log that a record would be without a sensor's or the air's effect.

    Found by rounds: what the effect would make of it has to be the record.
    """
    if effect.distort is None:
        return record
    clean = record
    for _ in range(_ROUNDS):
        again = effect.distort(dict(settings), clean)
        channels = [
            replace(clean.channel(name), values=clean[name] + record[name] - again[name])
            for name in record.channels
            if not np.array_equal(again[name], clean[name]) or not np.array_equal(clean[name], record[name])
        ]
        clean = clean.with_channels(*channels)
    return clean
