"""The control law that a record shows: commands without injected signals, fitted by attitude and rates."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from freqid.core.arrays import Array
from freqid.core.record import FlightRecord

HEARD = ("phi", "theta", "p", "q", "r")
"""States that a law is sought in."""

_EXPLAINED = 0.8  # of a command's variance beside the injected signal, from which a law makes it


def law(record: FlightRecord, rest: Array, injected: Sequence[bool]) -> tuple[Array, NDArray[np.bool_]]:
    """Return a law without memory that makes commands of attitude and rates.

    A simulation that flies by the commands of a log flies by feedback to the gusts and the noise of that
    log too; by its own feedback its flight has neither, and stays where the aircraft stayed.

    Parameters
    ----------
    record : FlightRecord
    rest : ndarray, shape (command, sample)
        Commands without the injected signals.
    injected : sequence of bool
        By command, whether the record has the injected signal. Other commands get no law: a pilot's input
        moves the aircraft, and so correlates with its motion as a law's command would.

    Returns
    -------
    gains : ndarray, shape (command, state)
        By rad or rad/s of the states in `HEARD`, by least squares; zero of commands that stand still, and
        of those that no such law makes.
    by_law : ndarray of bool, shape (command,)
        Whether that law explains the command.
    """
    names = [f"state/{n}" for n in HEARD]
    heard = np.array([record[n] if n in record else 0 * record.time for n in names])
    heard = heard - heard.mean(axis=1, keepdims=True)
    moved = rest - rest.mean(axis=1, keepdims=True)
    gains = np.linalg.lstsq(heard.T, moved.T, rcond=1e-9)[0].T
    whole, left = (moved**2).sum(axis=1), ((moved - gains @ heard) ** 2).sum(axis=1)
    by_law = np.array(injected, dtype=bool) & (left <= (1 - _EXPLAINED) * whole)
    return np.where(by_law[:, None], gains, 0.0), by_law
