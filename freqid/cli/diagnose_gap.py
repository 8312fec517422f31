"""``freqid diagnose-gap``: whether simulation and flights differ, where, by which effect, and how far."""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

import click

from freqid import __version__
from freqid.cli import options

if TYPE_CHECKING:
    from freqid.core.results.diagnosis import GapDiagnosis, ToleranceUsed
    from freqid.core.scenario import Scenario
    from freqid.gap.diagnose import Findings, Question
    from freqid.gap.simulation import Simulation
    from freqid.simulate.effects.effect import Effect

_SIGMAS = 1.645  # of a 90 % interval, to either side


@click.command("diagnose-gap")
@click.argument("records", metavar="RECORD...", nargs=-1, required=True, type=click.Path(path_type=Path))
@options.output("the first record's name with -gap.h5")
@options.simulation("Vehicle, tolerances and band; without --sim, the simulation.", several=True)
@click.option(
    "--holdout",
    multiple=True,
    type=click.Path(path_type=Path),
    help="Flight on which closures are scored; may be repeated. Without it, RECORDs take turns.",
)
@click.option(
    "--effect", "named", multiple=True, help="Effect to close the gap with; may be repeated: together."
)
@click.option(
    "--effects", "own", type=click.Path(path_type=Path), help="Python file with effects of your own."
)
@options.band("the scenario's, else what the injected signals drive")
@click.option(
    "--tolerance",
    "given",
    multiple=True,
    metavar="NAME=SIGMA",
    help="One sigma of what is no gap, over the scenario's [tolerance]; may be repeated.",
)
@click.option(
    "--level",
    type=click.FloatRange(0, 1, min_open=True, max_open=True),
    default=0.02,
    show_default=True,
    help="At which a gap is called one: so many false alarms.",
)
@click.option(
    "--draws",
    type=click.IntRange(min=100),
    default=500,
    show_default=True,
    help="Of flights without a gap, with noise and tolerances, for the level.",
)
@click.option("--seed", type=int, default=0, show_default=True, help="Of the draws.")
@click.option(
    "--next-flight/--no-next-flight",
    "plan",
    default=True,
    help="Where several explanations remain, propose the tests that would tell them apart.",
)
@click.option(
    "--self-test",
    is_flag=True,
    help="Try the diagnosis on each effect inserted into this simulation and these flights.",
)
@click.option("--anyway", is_flag=True, help="Go on where mistakes of bookkeeping are found.")
@options.page("the diagnosis")
@options.as_json
def command(
    records: tuple[Path, ...],
    destination: Path | None,
    sim: tuple[str, ...],
    predictions: tuple[Path, ...],
    scenario: Path | None,
    holdout: tuple[Path, ...],
    named: tuple[str, ...],
    own: Path | None,
    band: str | None,
    given: tuple[str, ...],
    level: float,
    draws: int,
    seed: int,
    plan: bool,
    self_test: bool,
    anyway: bool,
    page: bool,
    json_: bool,
) -> None:
    """Diagnose the gap between a simulation and the flights RECORD....

    Says whether there is a gap beyond noise and tolerances, where it is, which effect of the library makes
    it, and how much of it goes on flights that were not used once that effect is added. Looks for mistakes
    of bookkeeping first and stops there with exit code 4 where it finds any.

    With two simulations, --sim A --sim B or --sim A --predictions B.h5, says which of them is nearer to the
    flights, where, and whether that is beyond noise and tolerances.
    """
    from dataclasses import replace

    from freqid.cli import compare_simulations
    from freqid.cli.compare_simulations import Asked
    from freqid.cli.gap_texts import bookkeeping_text, diagnosis_text
    from freqid.core.errors import GateFailed, UsageError, nearest
    from freqid.core.record import read_record
    from freqid.core.results.gap import write_gap
    from freqid.core.scenario import read_scenario
    from freqid.gap import flights
    from freqid.gap.bookkeeping.check import check
    from freqid.gap.bookkeeping.gyroscopic import rotor_account
    from freqid.gap.connect import connect
    from freqid.gap.diagnose import Question, diagnose
    from freqid.gap.model.tolerance import stated
    from freqid.gap.shown import shown
    from freqid.gap.verdict import tolerances_used

    rivals = compare_simulations.rivals(sim, predictions, holdout, named)
    kind = "rivals" if rivals else "gap"
    destination = destination or records[0].with_name(f"{records[0].stem}-{kind}.h5")
    drawn = destination.with_suffix(".html") if page else None
    design_file = destination.with_name(f"{destination.stem}-next.h5")
    for result in (destination, drawn, design_file):
        if result:
            options.keep_inputs(result, *records, *holdout, *predictions, scenario, own)
    _once(records, holdout)
    named = tuple(dict.fromkeys(named))
    library = _library(own)
    for name in named:
        if name not in library:
            raise UsageError(f"effect '{name}' is unknown", remedy=nearest(name, library))
    if scenario is None:
        scenario = next((Path(s) for s in sim if s.endswith(".toml")), None)
    described, sha256 = read_scenario(scenario) if scenario else (None, "")
    sigmas = {**(described.tolerance if described else {}), **_sigmas(given)}
    span = _band(band, described)
    read = [read_record(path) for path in (*records, *holdout)]
    names = [str(path) for path in (*records, *holdout)]
    tell = _teller()
    if rivals:
        pair = [connect(s, scenario=scenario, predictions=p, record=read[0]) for s, p in rivals]
        how = Asked(described, library, sigmas, span, level, seed)
        sources = {"scenario": {"file": str(scenario or ""), "sha256": sha256}, "effects": str(own or "")}
        compare_simulations.run(
            (pair[0], pair[1]), read, names, how, destination, drawn, sources, json_, tell
        )
        return
    simulation = connect(sim[0] if sim else None, scenario=scenario, predictions=predictions, record=read[0])
    vehicle = flights.vehicle_of(read, simulation, described.aircraft() if described else None)
    every = flights.maneuvers(read, names, simulation, vehicle)
    flights.refuse_unmeasured(every, names, simulation)
    flights.refuse_without_noise(read, names)
    tolerances = stated(sigmas, library, simulation, every[0].vehicle)
    here = {i: effect.of(every[0].vehicle) for i, effect in library.items()}
    _refuse_absurd(sigmas, tolerances_used(sigmas, simulation, here))
    rotors = rotor_account(simulation, [m.record for m in every], vehicle)
    if rotors.vehicle not in (None, vehicle or every[0].vehicle):
        vehicle = rotors.vehicle
        every = flights.maneuvers(read, names, simulation, vehicle)
    used, kept = every[: len(records)], every[len(records) :]

    tell("looking for mistakes of bookkeeping")
    faults = check(simulation, [m.record for m in used], vehicle)
    if faults and not anyway:
        tell("")
        verdict = f"Bookkeeping, not physics: {faults[0].sentence}."
        table = {
            "verdict": verdict,
            "simulation": simulation.name,
            "records": names,
            "bookkeeping": [asdict(f) for f in faults],
        }
        options.emit(json_, table, bookkeeping_text(verdict, faults))
        raise GateFailed(
            f"{len(faults)} mistake{'s' if len(faults) > 1 else ''} of bookkeeping between simulation "
            "and flight; no gap was diagnosed",
            remedy="mend and diagnose again, or go on with --anyway",
        )
    question = Question(
        candidates=library,
        tolerances=tolerances,
        band_hz=span or flights.injected_band(read),
        named=named,
        level=level,
        draws=draws,
        seed=seed,
    )
    findings = diagnose(simulation, used, question, held_out=kept, names=names, tell=tell)
    tell("costing margins")
    found = _with_consequence(findings, simulation, question)
    if plan:
        from freqid.gap.next.next_test import next_test

        proposed = next_test(
            findings, simulation, question, described, design_file, scenario_sha256=sha256, tell=tell
        )
        found = replace(found, next_flight=proposed)
    if self_test:
        from freqid.gap.self_test.self_test import self_test as tried
        from freqid.gap.self_test.self_test import with_self_test

        found = with_self_test(found, tried(findings, library, tell=tell))
    remarks = [
        *(f"bookkeeping: {f.sentence}; {f.remedy}" for f in faults),
        *flights.differing(every, simulation),
        *([rotors.sentence.rstrip(".")] if rotors.sentence else []),
    ]
    found = replace(found, remarks=(*remarks, *found.remarks))
    provenance = {
        "simulation": simulation.name,
        "kind": simulation.kind,
        "records": [str(path) for path in records],
        "held out": [str(path) for path in holdout],
        "scenario": {"file": str(scenario or ""), "sha256": sha256},
        "effects": str(own or ""),
        "band_hz": list(question.band_hz),
        "level": level,
        "draws": draws,
        "seed": seed,
        "self_test": self_test,
        "freqid_version": __version__,
    }
    result = shown(replace(findings, diagnosis=found), tolerances, provenance)
    write_gap(destination, result, sha256)
    if drawn:
        from freqid.report.gap.page import build_gap_page
        from freqid.report.kit.rendering import write_text

        tell("drawing")
        write_text(drawn, build_gap_page(result))
    tell("")
    table = found.to_json() | {
        "bookkeeping": [asdict(f) for f in faults],
        "file": str(destination),
        "page": str(drawn or ""),
    }
    options.emit(json_, table, diagnosis_text(found) + f"\n\n{destination}" + (f"\n{drawn}" if drawn else ""))


def _with_consequence(findings: Findings, simulation: Simulation, question: Question) -> GapDiagnosis:
    """Return the diagnosis with what the effects that it names cost in margins, modes and trim."""
    import numpy as np
    from scipy.linalg import block_diag

    from freqid.compare.diagnosis_consequence import with_consequence

    diagnosis = findings.diagnosis
    if not findings.closed or not (diagnosis.which.named or diagnosis.which.pair or question.named):
        return diagnosis
    settings: dict[str, dict[str, float]] = {}
    baseline: dict[str, dict[str, float]] = {}
    names: list[tuple[str, str]] = []
    spread = []
    for e in findings.closed[0].explanation.estimates:
        c = e.candidate
        settings[c.effect] = c.settings(e.size)
        own = simulation.effects.get(c.effect, {})
        baseline[c.effect] = {n: own.get(n, 0.0) for n, _ in c.place.fixed}  # these are no departures
        names += [(c.effect, n) for n in c.place.parameters]
        sigma = np.broadcast_to((e.hi - e.lo) / (2 * _SIGMAS), (len(c.place.parameters),))
        # one size for all places of a group moves them together
        spread.append(np.outer(sigma, sigma) if c.kind == "scalar" else np.diag(sigma**2))
    return with_consequence(diagnosis, simulation, settings, names, block_diag(*spread), baseline=baseline)


def _sigmas(given: Sequence[str]) -> dict[str, float]:
    """Return the tolerances of ``--tolerance`` by name."""
    from freqid.core.errors import UsageError

    found = {}
    for word in given:
        name, _, value = word.partition("=")
        try:
            found[name.strip()] = float(value)
        except ValueError:
            raise UsageError(f"--tolerance is NAME=SIGMA such as mass=0.01, not '{word}'") from None
    return found


def _refuse_absurd(sigmas: Mapping[str, float], used: Sequence[ToleranceUsed]) -> None:
    """Refuse a share of more than all: it would swallow every gap."""
    from freqid.core.errors import DataError

    for one in used:
        if one.name in sigmas and one.source != "simulation" and one.unit == "1" and one.sigma > 1:
            raise DataError(
                f"the tolerance {one.name} is {one.sigma:g}, a share of more than all",
                remedy="give one standard deviation as a share: 0.05 for 5 %",
            )


def _once(records: tuple[Path, ...], holdout: tuple[Path, ...]) -> None:
    """Refuse a file that is named twice."""
    from freqid.core.errors import UsageError

    seen: set[Path] = set()
    for path in records:
        if path.resolve() in seen:
            raise UsageError("is given twice", where=str(path), remedy="name each record once")
        seen.add(path.resolve())
    held: set[Path] = set()
    for path in holdout:
        if path.resolve() in seen:
            raise UsageError(
                "is both used and held out", where=str(path), remedy="hold out a flight that is not used"
            )
        if path.resolve() in held:
            raise UsageError("is held out twice", where=str(path), remedy="name each record once")
        held.add(path.resolve())


def _library(own: Path | None) -> dict[str, Effect]:
    """Return the effects that are asked about: all that are shipped, and the user's."""
    from freqid.simulate.effects import library, register
    from freqid.simulate.effects.files import load_file

    for effect in load_file(own).values() if own else ():
        register(effect)
    return library()


def _band(text: str | None, described: Scenario | None) -> tuple[float, float] | None:
    if text is not None:
        return options.band_hz(text)
    return described.excitation.band_hz if described and described.excitation else None


def _teller():
    """Return what tells of progress: a line on a terminal that is written over, nothing elsewhere."""
    if not sys.stderr.isatty():
        return lambda text: None
    return lambda text: click.echo(f"\r\033[K{text}", nl=False, err=True)
