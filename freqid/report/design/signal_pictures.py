"""All signals of a design over time, group after group, in figures of equal height."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from freqid.core.arrays import Array
from freqid.core.results.design import ClassicDesign, MultisineDesign
from freqid.core.vehicle import Vehicle
from freqid.report.design import figures
from freqid.report.kit.effectors import effector_groups, engineering
from freqid.report.kit.notation import number, pretty_unit
from freqid.report.kit.pictures import Picture, picture

_ROWS = 18  # signals in one figure at most: then it is as tall as the spectra beside it


def signal_pictures(
    design: MultisineDesign | ClassicDesign,
    vehicle: Vehicle,
    time: Array,
    values: Array,
    when: str,
    note: str,
) -> list[Picture]:
    """Draw signals one below the other, an odd number of figures: with the spectra, pairs.

    Parameters
    ----------
    design : MultisineDesign or ClassicDesign
        Names and units of the signals.
    vehicle : Vehicle
        Its groups of effectors have one colour and one scale each.
    time : ndarray, shape (sample,)
        s.
    values : ndarray, shape (effector, sample)
    when, note : str
        What stretch of time it is, and what else to know, for the captions.
    """
    peak = np.abs(values).max(axis=1)
    rows, scale, colours, notes = [], {}, {}, {}
    for colour, places in zip(
        figures.GROUP_COLOURS, effector_groups(design.names, vehicle).values(), strict=False
    ):
        rows += places
        for i in places:
            unit, factor = engineering(design.units[i])
            scale[i], colours[i] = float(peak[places].max()), colour
            notes[i] = f"{number(factor * peak[i])} {pretty_unit(unit)}"
    count = -(-len(rows) // _ROWS)
    count += 1 - count % 2
    pictures = []
    for low, high in pairwise(np.linspace(0, len(rows), count + 1).round().astype(int)):
        part = rows[low:high]
        names = [design.names[i] for i in part]
        several = f"Signals {names[0]} to {names[-1]}" if len(part) > 1 else f"Signal {names[0]}"
        pictures.append(
            picture(
                figures.signal_rows(
                    names,
                    time,
                    values[part],
                    [scale[i] for i in part],
                    [notes[i] for i in part],
                    [colours[i] for i in part],
                ),
                f"signals{low}",
                f"Signals over {when}: {', '.join(names)}",
                f"{several} over {when}. {note}",
            )
        )
    return pictures
