"""What a comparison of two simulations says, the shape of its ``--json``; its file is ``freqid-rivals``."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import h5py
import msgspec
import numpy as np

from freqid.core import store
from freqid.core.viewable import Viewable


@dataclass(frozen=True)
class Span:
    """A number with its 90 % interval."""

    value: float
    lo: float
    hi: float


@dataclass(frozen=True)
class Contest:
    """Two simulations in one response, band and regime, or over all of them.

    Attributes
    ----------
    response : str
        ``M``; ``actuator/de1``; ``all``.
    band_hz : tuple of 2 floats
    regime : str
        Reference condition, or ``all``.
    count : int
        White numbers that are compared.
    maneuvers : int
        That hold them.
    misfit_a, misfit_b : Span
        Explainable energy by white number: 0 is noise alone, 1 as much again as noise and tolerances.
    energy_a, energy_b : float
        Explainable energy: the sum of whitened squares less what noise and tolerances make.
    difference : Span
        ``energy_a - energy_b``, positive where B is nearer.
    less : float
        Share of the farther one's explainable energy that the other does not have, 0 to 1.
    p : float
        How often equal simulations differ as much, for this contest alone.
    p_adjusted : float
        The same for all contests together (Holm).
    nearer : str
        ``A`` or ``B``; empty where the flights cannot tell.
    """

    response: str
    band_hz: tuple[float, float]
    regime: str
    count: int
    maneuvers: int
    misfit_a: Span
    misfit_b: Span
    energy_a: float
    energy_b: float
    difference: Span
    less: float
    p: float
    p_adjusted: float
    nearer: str


@dataclass(frozen=True)
class Rivals(Viewable):
    """Two simulations compared on the same flights.

    Attributes
    ----------
    verdict : str
        One line.
    simulations : tuple of 2 str
        A and B.
    records : tuple of str
    level : float
        How often equal simulations would be told apart anywhere.
    identical : bool
        Whether both say exactly the same.
    overall : Contest
    contests : tuple of Contest
        Each response as a whole, then by band and regime, where the two differ at all.
    smallest_difference : float
        Share of the farther one's misfit below which neither is called nearer.
    form_errors : tuple of 2 floats
        Error of form of the loads of A and B beyond tolerances, as a share of each term.
    remarks : tuple of str
    provenance : dict
    """

    verdict: str
    simulations: tuple[str, str]
    records: tuple[str, ...]
    level: float
    identical: bool
    overall: Contest
    contests: tuple[Contest, ...]
    smallest_difference: float = 0.01
    form_errors: tuple[float, float] = (0.0, 0.0)
    remarks: tuple[str, ...] = ()
    provenance: dict[str, Any] = field(default_factory=dict)

    def __repr__(self) -> str:
        return f"<Rivals {' and '.join(self.simulations)} on {len(self.records)} flights: {self.verdict}>"

    @property
    def nearer(self) -> str:
        """``A``, ``B``, ``both`` where each is nearer somewhere, or empty where the flights cannot tell."""
        found = {c.nearer for c in (self.overall, *self.contests)} - {""}
        return "both" if len(found) > 1 else "".join(found)

    def to_json(self) -> dict[str, Any]:
        """Return numbers, strings, lists and tables, all finite."""
        return {**asdict(self), "nearer": self.nearer}

    @classmethod
    def from_json(cls, table: Mapping[str, Any]) -> Rivals:
        """Return the comparison that `to_json` made a table of.

        Parameters
        ----------
        table : mapping
            JSON-compatible.

        Raises
        ------
        ValueError
            Where the table is none of a comparison.
        """
        try:
            return msgspec.convert(dict(table), cls)
        except msgspec.ValidationError as error:
            raise ValueError(str(error)) from None


FORMAT = "freqid-rivals"


def write_rivals(path: Path, found: Rivals, scenario_sha256: str = "") -> None:
    """Write a comparison, whole or not at all.

    Raises
    ------
    DataError
        Where the folder cannot be written.
    """

    def fill(file: h5py.File) -> None:
        text = file.create_dataset("comparison", data=json.dumps(found.to_json(), allow_nan=False))
        text.attrs["units"] = "JSON"
        group = file.create_group("contest")
        every = (found.overall, *found.contests)
        store.put_json(group, "response", [c.response for c in every])
        store.put_json(group, "regime", [c.regime for c in every])
        store.put(group, "bands", np.array([c.band_hz for c in every]), "Hz")
        for name in ("misfit_a", "misfit_b", "difference"):
            spans = [getattr(c, name) for c in every]
            store.put(group, name, np.array([(s.value, s.lo, s.hi) for s in spans]), "1")
        store.put(group, "p_adjusted", np.array([c.p_adjusted for c in every]), "1")

    store.write(path, FORMAT, fill, scenario_sha256)


def read_rivals(path: Path) -> Rivals:
    """Read a comparison.

    Raises
    ------
    DataError
        Where the file is no intact comparison.
    """
    with store.reading(path, FORMAT) as file:
        return Rivals.from_json(json.loads(store.dataset(file, "comparison")[()]))
