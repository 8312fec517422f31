"""All plausibility checks of one record."""

from __future__ import annotations

from freqid.core.record import FlightRecord
from freqid.core.scenario import Reference
from freqid.flightlog.plausibility import ranges, repeats
from freqid.flightlog.plausibility.finding import Finding, PlausibilityReport
from freqid.flightlog.plausibility.mistakes import contradictions, find_mistakes
from freqid.flightlog.plausibility.relations import relations, thinned

SHORTEST = 64  # samples; less says nothing about kinematics


def check_plausibility(record: FlightRecord, reference: Reference | None = None) -> PlausibilityReport:
    """Tell whether a record can be what it claims to be.

    Parameters
    ----------
    record : FlightRecord
        As it was read; limits are those of its vehicle.
    reference : Reference, optional
        The condition that is said to have been flown.

    Returns
    -------
    PlausibilityReport

    Notes
    -----
    Relations between channels, units, signs: `freqid.flightlog.plausibility.mistakes`. What a mistake of the
    unit explains is not reported a second time as values beyond limits.
    """
    findings: list[Finding] = []
    agreement = {}
    missed: dict[str, str] = {}
    stray = tuple(ranges.stray_samples(record))
    if record.time.size >= SHORTEST:
        fewer = thinned(ranges.bridged(record, stray))
        known = relations(fewer)
        found, before, right = find_mistakes(fewer, known)
        findings += found
        left, missed = contradictions(fewer, known, right)
        findings += left
        agreement = {name: a.concordance for name, a in before.items()}
    explained = {name for f in findings if f.check == "unit" for name in f.channels}
    more = [
        *ranges.physical(record),
        *ranges.unknown(record),
        *ranges.stated(record),
        *ranges.spikes(record, stray),
        *ranges.at_reference(record, reference),
        *repeats.stuck(record),
        *repeats.constant(record, missed),
        *repeats.latched(record),
    ]
    findings += [f for f in more if f.check == "spike" or not explained.issuperset(f.channels)]
    findings.sort(key=lambda f: f.severity != "error")
    return PlausibilityReport(tuple(findings), agreement)
