"""What a comparison of two simulations says, the shape of its ``--json``; its file is ``freqid-rivals``."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

import msgspec

from freqid.core.layout import Attribute, Dataset, ResultFile, Rows
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
    def every(self) -> tuple[Contest, ...]:
        """Over all responses, then by response, band and regime."""
        return (self.overall, *self.contests)

    @property
    def nearer(self) -> str:
        """``A``, ``B``, ``both`` where each is nearer somewhere, or empty where the flights cannot tell."""
        found = {c.nearer for c in self.every} - {""}
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


_CONTESTS = {
    "response": Attribute("contest@response", json=True),
    "regime": Attribute("contest@regime", json=True),
    "band_hz": Dataset("contest/bands", "Hz"),
    **{name: Dataset(f"contest/{name}") for name in ("misfit_a", "misfit_b", "difference", "p_adjusted")},
}
FILE = ResultFile("freqid-rivals", Rivals, {"every": Rows(Contest, _CONTESTS)}, table="comparison")
write_rivals, read_rivals = FILE.write, FILE.read
