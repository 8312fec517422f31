"""Which single mistake of a map, a unit, a sign or a column, explains that channels contradict each other.

Notes
-----
Each mistake is undone in turn and all relations that it touches are computed anew. With the concordance ``c``
of a relation, ``1 - c`` is the energy of the difference over that of both signals; under Gaussian differences
the log likelihood of a mistake gains ``n / 2 ln((1 - c_before) / (1 - c_after))`` by each relation. The one
that gains most is reported, undone, and the rest is searched again.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import combinations
from math import log, pi

import numpy as np

from freqid.core.channels import EFFECTOR_GROUPS, si_unit
from freqid.core.record import FlightRecord
from freqid.flightlog.plausibility.finding import Finding
from freqid.flightlog.plausibility.relations import Agreement, Relation, Signals

HALF = 0.5  # concordance at which half of the signals' energy is in their difference
SUSPECT = 0.85  # concordance of signals that differ by 1.8: no unit is off by less
HALVED = 0.5  # of 1 - c, that undoing a mistake must leave at most of what it explains
FLOOR = 0.02  # of 1 - c, that scale errors, delays and levers of healthy sensors cause
# Gain of log likelihood from which a mistake is believed, beyond the logarithm of how many were tried: one
# log in ten thousand is accused by chance.
SURE = log(1e4)
AS_LIKELY = log(20.0)  # within which another mistake explains the same
MOST_MISTAKES = 6
UNITS: dict[str, dict[str, float]] = {
    "rad": {"deg": pi / 180},
    "rad/s": {"deg/s": pi / 180},
    "rad/s2": {"deg/s2": pi / 180},
    "m/s": {"ft/s": 0.3048, "kt": 0.514444, "km/h": 1 / 3.6, "mph": 0.44704},
    "m/s2": {"g": 9.80665, "ft/s2": 0.3048},
    "m": {"ft": 0.3048},
    "Pa": {"psf": 47.880259, "hPa": 100.0},
    "kg/m3": {"slug/ft3": 515.378818},
    "N": {"lbf": 4.4482216, "kgf": 9.80665},
    "1": {"%": 0.01},
}
ROTOR_UNITS = {"rpm": 2 * pi / 60, "rev/s": 2 * pi}
GROUPS: tuple[tuple[str, ...], ...] = (
    ("state/p", "state/q", "state/r"),
    ("state/phi", "state/theta", "state/psi"),
    ("state/ax", "state/ay", "state/az"),
    ("state/u", "state/v", "state/w"),
    ("air/V", "state/u", "state/v", "state/w"),
    ("air/alpha", "air/beta"),
    ("state/vn", "state/ve", "state/vd"),
    ("state/pdot", "state/qdot", "state/rdot"),
)
# Axes that point left and up instead of right and down.
TURNED_AXES: tuple[tuple[str, ...], ...] = (
    ("state/q", "state/r"),
    ("state/ay", "state/az"),
    ("state/v", "state/w"),
    ("state/q", "state/r", "state/ay", "state/az"),
    ("state/q", "state/r", "state/ay", "state/az", "state/theta", "state/psi"),
)
INTERCHANGED: tuple[tuple[str, str], ...] = (
    ("state/p", "state/r"),
    ("state/p", "state/q"),
    ("state/q", "state/r"),
    ("state/phi", "state/theta"),
    ("state/phi", "state/psi"),
    ("state/theta", "state/psi"),
    ("state/u", "state/w"),
    ("state/v", "state/w"),
    ("air/alpha", "air/beta"),
    ("state/ax", "state/az"),
    ("state/ay", "state/az"),
    ("state/ax", "state/ay"),
)


@dataclass(frozen=True)
class Mistake:
    """One way in which a map can be wrong, and how to undo it.

    Attributes
    ----------
    kind : {"unit", "sign", "swap", "axes"}
    channels : tuple of str
    factor : mapping of str to float
    column : mapping of str to str
    unit : str
        That the channels' values are in, where it is the unit.
    converted_from : str
        Unit that values in `unit` were converted from, though they were in `unit` already.
    """

    kind: str
    channels: tuple[str, ...]
    factor: Mapping[str, float] = field(default_factory=dict)
    column: Mapping[str, str] = field(default_factory=dict)
    unit: str = ""
    converted_from: str = ""


def find_mistakes(
    record: FlightRecord, among: Sequence[Relation]
) -> tuple[list[Finding], dict[str, Agreement], Signals]:
    """Return the mistakes that explain contradictions, all agreements as logged, and the signals put right.

    Parameters
    ----------
    record : FlightRecord
    among : sequence of Relation
        Those that its channels allow.
    """
    signals = Signals(record)
    known = {r.name: found for r in among if (found := r.agreement(signals)) is not None}
    as_logged = dict(known)
    tried = list(_mistakes(record))
    findings = []
    for _ in range(MOST_MISTAKES):
        scored = []
        for mistake in tried:
            touched = [r for r in among if r.name in known and set(r.channels) & set(mistake.channels)]
            if not any(known[r.name].concordance < SUSPECT for r in touched):
                continue
            undone = _undone(signals, mistake)
            after = {r.name: r.agreement(undone) for r in touched}
            scored.append((_gain(known, after), mistake, after))
        scored.sort(key=lambda s: (-s[0], len(s[1].channels)))
        sure = [s for s in scored if s[0] > SURE + log(len(tried))]
        found = next((s for s in sure if s[0] > _gain_without(signals, s[1], among, known) + AS_LIKELY), None)
        if found is None:
            break
        best, mistake, after = found
        alike = [m for gain, m, _ in scored if m is not mistake and gain > best - AS_LIKELY]
        findings.append(_finding(record, mistake, alike, known, after, best))
        signals = _undone(signals, mistake)
        known |= {name: found for name, found in after.items() if found is not None}
    return findings, as_logged, signals


def contradictions(
    record: FlightRecord, among: Sequence[Relation], signals: Signals
) -> tuple[list[Finding], dict[str, str]]:
    """Return what remains in contradiction after all mistakes are undone, and what constant channels miss.

    Returns
    -------
    findings : list of Finding
        Warnings: two signals that are clearly alike, of another size or sign than any unit explains.
    missed : dict of str to str
        By channel without any change: what others say that it should do.
    """
    findings, missed = [], {}
    for relation in among:
        found = relation.agreement(signals)
        first = relation.channels[0]
        if found is None:
            continue
        if np.ptp(record[first]) == 0 and _moves(relation, signals):
            missed[first] = f"{_listed(relation.channels[1:3])} imply that it moves"
        elif abs(found.correlation) > 0.5**0.5 and found.concordance < HALF and found.equations > 8:
            others = _listed(relation.channels[1:])
            sign = ", with the opposite sign" if found.correlation < 0 else ""
            findings.append(
                Finding(
                    "warning",
                    "contradiction",
                    relation.channels,
                    f"{relation.name}: '{first}' is {found.gain:.3g} times what {others} imply{sign}, with a "
                    f"correlation of {found.correlation:.2f}, and no unit explains that",
                    f"check unit and sign of '{first}' and of {others} in the map",
                    {"gain": found.gain, "correlation": found.correlation, "concordance": found.concordance},
                )
            )
    return findings, missed


def _moves(relation: Relation, signals: Signals) -> bool:
    """Tell whether what is implied of a channel is more than the noise of what implies it.

    Noise is spread over all lines, motion stands in few: the participation number tells them apart.
    """
    _, implied = relation.pair(signals)
    power = np.abs(implied) ** 2
    total = power.sum()
    mean_square = float(np.var(np.abs(signals.record[relation.channels[1]])))
    return bool(total > 0 and mean_square > 0 and 1 / np.sum((power / total) ** 2) < 0.25 * power.size)


def _gain(before: Mapping[str, Agreement], after: Mapping[str, Agreement | None]) -> float:
    """Return the gain of log likelihood; none unless what was contradictory agrees and the rest stays so."""
    if any(found is None for found in after.values()):
        return -np.inf
    healed = any(found is not None and _heals(before[name], found) for name, found in after.items())
    return _log_likelihood(before, after) if healed else -np.inf


def _log_likelihood(before: Mapping[str, Agreement], after: Mapping[str, Agreement | None]) -> float:
    """Return the gain of log likelihood; a relation that has nothing left to compare gains nothing."""
    total = 0.0
    for name, found in after.items():
        if found is not None:
            was = before[name]
            n = min(was.equations, found.equations)
            left, now = max(1 - was.concordance, FLOOR), max(1 - found.concordance, FLOOR)
            total += n / 2 * log(left / now)
    return total


def _gain_without(
    signals: Signals, mistake: Mistake, among: Sequence[Relation], known: Mapping[str, Agreement]
) -> float:
    """Return what is gained by leaving channels out: as much, and they tell nothing of their unit or sign.

    A small unit makes any noisy channel smaller, which helps where its motion does not matter.
    """
    if not mistake.factor:
        return -np.inf
    touched = [r for r in among if r.name in known and set(r.channels) & set(mistake.channels)]
    silent = Signals(
        signals.record, {**signals.factor, **dict.fromkeys(mistake.channels, 0.0)}, signals.column
    )
    return _log_likelihood(known, {r.name: r.agreement(silent) for r in touched})


def _heals(was: Agreement, now: Agreement) -> bool:
    """Tell whether what contradicted itself agrees: most energy is common, and the difference is halved."""
    return (
        was.concordance < SUSPECT
        and now.concordance > HALF
        and 1 - now.concordance < HALVED * (1 - was.concordance)
    )


def _undone(signals: Signals, mistake: Mistake) -> Signals:
    factor = dict(signals.factor)
    for name, value in mistake.factor.items():
        factor[name] = factor.get(name, 1.0) * value
    column = dict(signals.column)
    if mistake.column:
        column |= {a: signals.column.get(b, b) for a, b in mistake.column.items()}
        factor |= {a: signals.factor.get(b, 1.0) for a, b in mistake.column.items()}
    return Signals(signals.record, factor, column)


def _mistakes(record: FlightRecord) -> Iterator[Mistake]:
    """Yield all mistakes that are tried."""
    names = [n for n in record.channels if not n.startswith(("power/", "response/"))]
    groups = [tuple(n for n in g if n in record) for g in GROUPS]
    for group in EFFECTOR_GROUPS:
        by_unit: dict[str, list[str]] = {}
        for n in record.group(group):
            by_unit.setdefault(record.channel(f"{group}/{n}").unit, []).append(f"{group}/{n}")
        groups += [tuple(together) for together in by_unit.values()]
    sets = dict.fromkeys([*((n,) for n in names), *(g for g in groups if len(g) > 1)])
    for channels in sets:
        yield Mistake("sign", channels, dict.fromkeys(channels, -1.0))
        for unit, factor in _units(record, channels[0]).items():
            yield Mistake("unit", channels, dict.fromkeys(channels, factor), unit=unit)
            claimed = record.channel(channels[0]).unit
            undone = dict.fromkeys(channels, 1 / factor)
            yield Mistake("unit", channels, undone, unit=claimed, converted_from=unit)
    for axes in TURNED_AXES:
        channels = tuple(n for n in axes if n in record)
        if len(channels) > 1:
            yield Mistake("axes", channels, dict.fromkeys(channels, -1.0))
    pairs = [pair for pair in INTERCHANGED if pair[0] in record and pair[1] in record]
    for group in EFFECTOR_GROUPS:
        pairs += [
            (f"{group}/{a}", f"{group}/{b}")
            for a, b in combinations(record.group(group), 2)
            if record.channel(f"{group}/{a}").unit == record.channel(f"{group}/{b}").unit
        ]
    for a, b in pairs:
        yield Mistake("swap", (a, b), column={a: b, b: a})


def _units(record: FlightRecord, name: str) -> Mapping[str, float]:
    """Return the units that a channel may be in instead of the SI unit that it is taken to be in."""
    unit = record.channel(name).unit
    if unit == "rad/s" and si_unit(name) is None:
        return ROTOR_UNITS
    return UNITS.get(unit, {})


def _finding(
    record: FlightRecord,
    mistake: Mistake,
    alike: Sequence[Mistake],
    before: Mapping[str, Agreement],
    after: Mapping[str, Agreement | None],
    gain: float,
) -> Finding:
    """Say what explains a contradiction, by how much, and what to change."""
    healed = {n: (before[n], a) for n, a in after.items() if a is not None and _heals(before[n], a)}
    told = max(healed, key=lambda n: healed[n][1].concordance - healed[n][0].concordance)
    was, now = healed[told]
    names = _listed(mistake.channels)
    claimed = record.channel(mistake.channels[0]).unit
    where = " and ".join(f'[[channel]] name = "{n}"' for n in mistake.channels)
    sources = ", ".join(dict.fromkeys(record.channel(n).source for n in mistake.channels))
    many = len(mistake.channels) > 1
    if mistake.converted_from:
        what = f"{names} {'have' if many else 'has'} been converted from {mistake.converted_from} but "
        what += f"{'were' if many else 'was'} logged in {mistake.unit}"
        setting = f'set unit = "{mistake.unit}" of {where} in the map'
    elif mistake.kind == "unit":
        what = f"{names} {'are' if many else 'is'} in {mistake.unit} where {claimed} is claimed"
        setting = f'set unit = "{mistake.unit}" of {where} in the map'
    elif mistake.kind == "swap":
        what = f"{names} are interchanged"
        setting = f"exchange the columns of {where} in the map"
    else:
        what = f"{names} {'have' if many else 'has'} the opposite sign"
        what += ", as of axes that point left and up" if mistake.kind == "axes" else ""
        signs = "the opposite sign (sign = -1, or none where it is set)"
        setting = f"set {signs} of {where} in the map"
    others = [f"{_listed(m.channels)} ({_in_words(m)})" for m in alike[:3]]
    doubt = f"; the same would follow from {', or '.join(others)}" if others else ""
    return Finding(
        "error",
        mistake.kind,
        mistake.channels,
        f"{what}: {told} is {was.gain:.3g} times what the other channels imply, with a correlation of "
        f"{was.correlation:.2f}; so corrected, {now.gain:.3g} and {now.correlation:.2f}{doubt}",
        f"{setting} (now {sources})",
        {
            "gain": was.gain,
            "correlation": was.correlation,
            "gain_corrected": now.gain,
            "correlation_corrected": now.correlation,
            "log_likelihood_gain": gain,
        },
    )


def _in_words(mistake: Mistake) -> str:
    wrong = f" not {mistake.converted_from}" if mistake.converted_from else ""
    return f"{mistake.kind} {mistake.unit}{wrong}" if mistake.unit else mistake.kind


def _listed(names: Sequence[str]) -> str:
    quoted = [f"'{n}'" for n in names]
    return quoted[0] if len(quoted) < 2 else ", ".join(quoted[:-1]) + " and " + quoted[-1]
