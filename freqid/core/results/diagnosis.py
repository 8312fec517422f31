"""What a diagnosis of the gap between a simulation and flights says; the shape of ``diagnose-gap --json``."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, field
from typing import Any, Literal

import msgspec

from freqid.core.layout import finite_table, table_with_nan
from freqid.core.results.gap_self_test import SelfTest
from freqid.core.viewable import Viewable

_SENSORS = "kinematic/"
_CHANGES = 0.02  # of an error, from which a relation between sensors is listed
ScoredOn = Literal["", "held out", "turns", "lines"]
_CLASSICAL = {"rmse": "rms of the response", "theil": "1", "J": "1"}

POOR_FORM = 0.05
"""Error of form from which a simulation is not confirmed where no gap is called, and an answer is limited."""


@dataclass(frozen=True)
class Existence:
    """Whether there is a gap beyond noise and tolerances.

    Attributes
    ----------
    exists : bool
    p : float
        How often noise and tolerances alone give as much, or the probability of no gap at even odds,
        whichever is larger.
    level : float
        At which it was asked.
    naive_p : float
        What a chi-square test of the residual, blind to tolerances, would say.
    smallest_detectable : dict of float
        By effect id: size that is found in 95 of 100 cases.
    unit : dict of str
        Of these sizes.
    largest_undetected : dict of float
        By effect id: size that would have been called a gap in 95 of 100 cases, where none was called.
    form_errors : dict of float
        Share by which the simulation's terms are wrong in form, as the record itself shows, by response.
    noise_from : tuple of str
        What the noise was learned from, by condition.
    """

    exists: bool
    p: float
    level: float
    naive_p: float
    smallest_detectable: dict[str, float] = field(default_factory=dict)
    unit: dict[str, str] = field(default_factory=dict)
    largest_undetected: dict[str, float] = field(default_factory=dict)
    form_errors: dict[str, float] = field(default_factory=dict)
    noise_from: tuple[str, ...] = ()

    @property
    def form_error(self) -> float:
        """The largest error of form of any response, a share."""
        return max(self.form_errors.values(), default=0.0)

    @property
    def unconfirmed(self) -> bool:
        """Whether no gap is called and the simulation is not confirmed: its form is too far off."""
        return not self.exists and self.form_error >= POOR_FORM


@dataclass(frozen=True)
class Place:
    """A part of the gap: one row of the residual on the lines of one injected signal.

    Attributes
    ----------
    response : str
        Row of the residual: ``M``, ``actuator/de1``, ``kinematic/w``.
    band_hz : tuple of 2 floats
        That holds most of it.
    regime : str
        Reference conditions that hold a tenth of it or more, in their order.
    input : str
        The injected signal; empty for all other lines together: those that no signal drives, the mean among
        them, and those of signals that hold less than a tenth of the gap or of the row.
    phase : str
        Third of the manoeuvres that holds it, or ``all``.
    share : float
        Of what is detectable of the gap.
    """

    response: str
    band_hz: tuple[float, float]
    regime: str
    input: str
    phase: str
    share: float


@dataclass(frozen=True)
class Interval:
    """An estimate with its interval."""

    estimate: float
    lo: float
    hi: float
    unit: str


@dataclass(frozen=True)
class Which:
    """Which effect.

    Attributes
    ----------
    probabilities : dict of float
        By effect id, ``none`` and ``other``.
    set : tuple of str
        Holds the truth with the stated confidence.
    aliases : tuple of tuple of str
        Groups that these data cannot separate.
    not_tested : dict of str
        Reason by effect id.
    parameters : dict of dict of Interval
        By effect id and parameter.
    calibrated : bool
        Whether the probabilities hold here.
    pair : tuple of str
        Two effects that together explain much more than either; empty where one does.
    calibrated_by : str
        Which known cases the probabilities were checked on.
    named : tuple of str
        The effect that is given as the answer, with those that it cannot be told from; empty where none is
        likely enough for that. The set may hold more.
    withdrawn : dict of str
        Names that manoeuvres which were left out do not bear out, with the reason.
    places : dict of str
        By effect id: the likeliest place, such as an effector.
    groups : dict of tuple of str
        Effectors by the name of their group.
    moves : dict of dict of float
        By effect id: what it makes of each load or position, over what that moves, the largest first; root
        mean squares over the lines but zero frequency.
    """

    probabilities: dict[str, float]
    set: tuple[str, ...]
    aliases: tuple[tuple[str, ...], ...]
    not_tested: dict[str, str]
    parameters: dict[str, dict[str, Interval]]
    calibrated: bool = False
    pair: tuple[str, ...] = ()
    calibrated_by: str = ""
    named: tuple[str, ...] = ()
    withdrawn: dict[str, str] = field(default_factory=dict)
    places: dict[str, str] = field(default_factory=dict)
    groups: dict[str, tuple[str, ...]] = field(default_factory=dict)
    moves: dict[str, dict[str, float]] = field(default_factory=dict)

    def changes(self, effect: str) -> dict[str, tuple[float, float]]:
        """Return the ends of the interval of each parameter of an effect; empty where none was estimated."""
        return {name: (x.lo, x.hi) for name, x in self.parameters.get(effect, {}).items()}


@dataclass(frozen=True)
class SensorFault:
    """A fault that the sensors show of each other, or beside the loads.

    Attributes
    ----------
    fault : str
        Effect id.
    channel : str
        Parameter: the channel or axis it is in.
    estimate, lo, hi : float
    unit : str
    """

    fault: str
    channel: str
    estimate: float
    lo: float
    hi: float
    unit: str


@dataclass(frozen=True)
class ToleranceUsed:
    """A tolerance that was allowed for.

    Attributes
    ----------
    name : str
    sigma : float
        One standard deviation.
    unit : str
        ``"1"`` for a share.
    source : {"stated", "simulation", "default", "each record", "clock"}
        The user, the simulation itself, or nobody; offsets that are another in each record; the log's rate.
    """

    name: str
    sigma: float
    unit: str
    source: str


@dataclass(frozen=True)
class Share:
    """Share of a gap that goes, with a bootstrap interval; NaN where there is nothing to close."""

    G: float
    lo: float
    hi: float
    why_undefined: str = ""


@dataclass(frozen=True)
class Change:
    """A figure before and after, and of the model that says nothing changes."""

    before: float
    after: float
    zero: float = float("nan")


@dataclass(frozen=True)
class Closure:
    """How far the gap shrinks once effects are added, where they were not fitted: see `scored`.

    Attributes
    ----------
    effects : tuple of str
    settings : dict of dict of Interval
        Refitted parameters, by effect id.
    wrench, response : Share
        Of the replayed residual with effect and tolerances, and of the motion that the simulation flies by
        itself under the injected signals.
    effect_only, tolerances_only : Share
        Of the replayed residual with the effect at nominal tolerances, and with tolerances alone.
    response_effect_only : Share
        Of the simulation's own flight with the effect at nominal tolerances.
    log_score : float
        Nats by which the effect predicts what was left out better than tolerances alone do.
    strained : dict of float
        Tolerances that would have to be off most without the effect, by name, in sigmas.
    rmse, theil, J : dict of Change
        RMSE and Theil's coefficient of replays by response; J of the simulation's own flight by state, mean
        over the injected signals.
    held_out : tuple of str
        Manoeuvres that it was scored on.
    note : str
        Where a parameter is not determined, or what helps here does not transfer.
    consequence : dict
        Margins and modes before and after, where a control law is known.
    scored : {"", "held out", "turns", "lines"}
        Flights that were held out from the whole diagnosis; all flights in turn, each with sizes fitted to
        the others; or every other line of the only flight. Empty in files that do not say so.
    """

    effects: tuple[str, ...]
    settings: dict[str, dict[str, Interval]]
    wrench: Share
    response: Share
    rmse: dict[str, Change]
    theil: dict[str, Change]
    J: dict[str, Change]
    held_out: tuple[str, ...]
    note: str = ""
    consequence: dict[str, Any] = field(default_factory=dict)
    effect_only: Share = field(default_factory=lambda: Share(math.nan, math.nan, math.nan))
    tolerances_only: Share = field(default_factory=lambda: Share(math.nan, math.nan, math.nan))
    response_effect_only: Share = field(default_factory=lambda: Share(math.nan, math.nan, math.nan))
    log_score: float = math.nan
    strained: dict[str, float] = field(default_factory=dict)
    scored: ScoredOn = ""

    @property
    def scored_text(self) -> str:
        """What it was scored on, and what of that was left out of the fit, as the end of a sentence."""
        names = [name.rpartition("/")[2] for name in self.held_out]
        on = f"on {' and '.join(n for n in (', '.join(names[:-1]), *names[-1:]) if n)}"
        if self.scored == "held out":
            return f"{on}, which {'were' if len(names) > 1 else 'was'} held out"
        if self.scored == "turns":
            others = "the other" if len(names) == 2 else "others"
            return f"{on} in turn, each with the size fitted to {others} (no manoeuvre was held out)"
        if self.scored == "lines":
            return f"{on}, with the size fitted to the lines between (no manoeuvre was held out)"
        return on

    @property
    def listed(self) -> tuple[str, ...]:
        """Rows whose figures are shown: responses, actuators, and relations between sensors that change."""
        return tuple(
            name
            for name, c in self.rmse.items()
            if not name.startswith(_SENSORS) or abs(c.after - c.before) > _CHANGES * c.before
        )

    def to_json(self) -> dict[str, Any]:
        """Return a table with one number before and after of each classical figure, and those by response.

        RMSE is over the response's own rms about its mean, which is what a model that says nothing changes
        is off by, root mean square over the responses; Theil and J are means, J over inputs too. Relations
        between sensors count in none of them: nothing is simulated there.
        """
        one = asdict(self)
        if not self.scored:  # of a file that does not say so
            del one["scored"]
        for name in _CLASSICAL:
            every: dict[str, Change] = getattr(self, name)
            changes = {k: c for k, c in every.items() if not k.startswith(_SENSORS)}
            over = {k: c.zero if name == "rmse" and c.zero > 0 else 1.0 for k, c in changes.items()}
            one[name] = {
                end: _mean((getattr(c, end) / over[k] for k, c in changes.items()), name == "rmse")
                for end in ("before", "after", "zero")
            }
            one[name] |= {"unit": _CLASSICAL[name], "by_response": {k: asdict(c) for k, c in every.items()}}
        return one


@dataclass(frozen=True)
class GapDiagnosis(Viewable):
    """The whole diagnosis.

    Attributes
    ----------
    verdict : str
        One line.
    simulation : str
    records : tuple of str
    gap : Existence
    where : tuple of Place
    which : Which
    how_far : tuple of Closure
        First what was asked for or found, then each effect alone.
    next_flight : dict
    remarks : tuple of str
    self_test : SelfTest, optional
        What the diagnosis makes of effects inserted into this simulation and these flights.
    sensors : tuple of SensorFault
        Faults of the sensors, which are no gap of the simulation.
    tolerances : tuple of ToleranceUsed
        What counts as no gap.
    """

    verdict: str
    simulation: str
    records: tuple[str, ...]
    gap: Existence
    where: tuple[Place, ...]
    which: Which
    how_far: tuple[Closure, ...] = ()
    next_flight: dict[str, Any] = field(default_factory=dict)
    remarks: tuple[str, ...] = ()
    self_test: SelfTest | None = None
    sensors: tuple[SensorFault, ...] = ()
    tolerances: tuple[ToleranceUsed, ...] = ()

    def __repr__(self) -> str:
        return f"<GapDiagnosis of {self.simulation!r} on {len(self.records)} flights: {self.verdict}>"

    def to_json(self) -> dict[str, Any]:
        """Return the diagnosis as ``diagnose-gap --json`` prints it: numbers, strings, lists and tables.

        A number that is not defined is None.
        """
        alone = {"+".join(c.effects): c.to_json() for c in self.how_far}
        first = next(iter(alone.values()), {})
        found = {
            "verdict": self.verdict,
            "simulation": self.simulation,
            "records": self.records,
            "gap": asdict(self.gap),
            "where": [asdict(place) for place in self.where],
            "which": {n: x for n, x in asdict(self.which).items() if n != "moves" or x},  # none: no gap
            "how_far": {**first, "per_effect": alone} if first else {},
            "next_flight": self.next_flight,
            "remarks": self.remarks,
            "sensors": [asdict(fault) for fault in self.sensors],
            "tolerances": [asdict(one) for one in self.tolerances],
        }
        if self.self_test:
            found["self_test"] = asdict(self.self_test)
        return finite_table(found)

    @classmethod
    def from_json(cls, table: Mapping[str, Any]) -> GapDiagnosis:
        """Return the diagnosis that `to_json` made a table of; None becomes NaN.

        Parameters
        ----------
        table : mapping
            JSON-compatible.

        Raises
        ------
        ValueError
            Where the table is none of a diagnosis.
        """
        closures = [
            {**one, **{n: one[n]["by_response"] for n in _CLASSICAL}}
            for one in (table["how_far"].get("per_effect") or {}).values()
        ]
        try:
            return msgspec.convert(table_with_nan({**table, "how_far": closures}), cls)
        except msgspec.ValidationError as error:
            raise ValueError(str(error)) from None


def _mean(values: Iterable[float], relative: bool = False) -> float:
    """Return the mean of the numbers that are finite, or their root mean square."""
    known = [v for v in values if math.isfinite(v)]
    if not known:
        return math.nan
    return math.sqrt(sum(v * v for v in known) / len(known)) if relative else sum(known) / len(known)
