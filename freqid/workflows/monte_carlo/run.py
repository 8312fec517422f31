"""A Monte Carlo campaign from its file to what a page shows; what is done is not done again."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable
from pathlib import Path

from freqid import __version__
from freqid.core.errors import UsageError, nearest
from freqid.core.extras import extra
from freqid.core.results.design import MultisineDesign, read_design
from freqid.core.results.judged.monte_carlo import FILE, MonteCarlo
from freqid.core.scenario import Scenario, find_scenario, read_scenario
from freqid.core.store import replacing
from freqid.simulate import runner
from freqid.simulate.cluster import cluster
from freqid.workflows.inputs import File, Tell, silent
from freqid.workflows.monte_carlo.plan import Planned, nested, read_plan
from freqid.workflows.monte_carlo.rows import summary_of
from freqid.workflows.monte_carlo.stages import KEYS, Case, Sources, cases, load_function
from freqid.workflows.studies import units


def monte_carlo(
    campaign: File,
    folder: File,
    *,
    axis: str = "",
    by: str = "",
    jobs: int = 2,
    workers: int = 0,
    scheduler: str = "",
    tell: Tell = silent,
    progress: Callable[[int, int], None] | None = None,
) -> MonteCarlo:
    """Do every combination of settings with every seed, and sum up coverage, bias, detections and alarms.

    What is done is kept: a second run, one after a stop, and one with more seeds go on from there.

    Parameters
    ----------
    campaign : path
        TOML file (docs/campaigns.md).
    folder : path
        Where rows are kept, ``rows/*.parquet`` with all settings in every row, and ``campaign.h5``.
    axis, by : str
        In place of those of the file: the setting that measures are stated against, and the one that makes
        curves. Neither makes anything be done again.
    jobs : int
        Processes on this machine; -1 for one a core.
    workers : int
        In their place, so many workers of a dask cluster on this machine.
    scheduler : str
        In their place, the address of a dask scheduler: ``tcp://host:8786``.
    tell : callable
        Told what begins, in a few words.
    progress : callable, optional
        Called with how many cases are done, and how many there are.

    Returns
    -------
    MonteCarlo

    Raises
    ------
    UsageError
        Where the file has an unknown key or setting, or several places to run on are given.
    DataError
        Where a file cannot be read, units of work fail, or pyarrow (extra ``parquet``) or dask.distributed
        (extra ``cluster``) is not installed.

    Examples
    --------
    >>> found = monte_carlo("noise.toml", "noise-campaign", axis="noise")  # doctest: +SKIP
    >>> [m.mean for m in found.of("coverage")]  # doctest: +SKIP
    """
    extra("pyarrow", "parquet")
    at = Path(folder)
    planned = read_plan(Path(campaign), axis, by)
    scenario, sources = _sources(planned, Path(campaign))
    _check(planned, scenario, sources)
    if scenario is not None and not sources.function:
        tell("inputs")
        sources = Sources(
            sources.scenario,
            sources.scenario_text,
            designs=_designs(planned, scenario, Path(sources.scenario), at / "units"),
        )
    batches = planned.plan.batches
    stage = planned.plan.stage
    if sources.function:  # its contents count, wherever the file lies
        stage = f"{stage.rpartition(':')[2]} of {hashlib.sha256(sources.function_text).hexdigest()}"
    inputs = [
        {"stage": stage, "setting": setting, "seeds": list(seeds)}
        for setting in planned.settings
        for seeds in batches
    ]
    total = planned.case_count
    tell(f"{total} cases in {len(inputs)} units")

    def told(done: int, of: int) -> None:
        if progress:
            progress(round(total * done / of), total)

    with cluster(scheduler, workers) as client:
        paths = runner.run_units(
            cases,
            inputs,
            at / "rows",
            scenario_sha256=scenario.sha256 if scenario else "",
            suffix=".parquet",
            beside={"sources": sources},
            jobs=jobs,
            client=client,
            listed=False,
            progress=told,
        )
    tell("summary")
    summary = summary_of(paths, planned.axis, planned.by)
    found = MonteCarlo(
        stage=planned.plan.stage,
        axis=planned.axis,
        by=planned.by,
        measured=summary.measured(),
        settings={
            **{n: [v] for n, v in planned.fixed.items()},
            **planned.factors,
            "seeds": [_seeds(planned)],
        },
        cases=summary.cases,
        rows=summary.rows,
        failed=summary.failed,
        failures=summary.failures,
        provenance={
            "campaign": {"file": planned.where, "sha256": planned.sha256},
            "scenario": {"file": scenario.file, "sha256": scenario.sha256} if scenario else {},
            "stage": planned.plan.stage,
            "freqid_version": __version__,
        },
    )
    FILE.write(at / "campaign.h5", found, scenario.sha256 if scenario else "")
    with replacing(at / "parts.json") as temporary:  # of these settings; others' rows may lie beside
        temporary.write_text(json.dumps([f"rows/{p.name}" for p in paths]) + "\n")
    return found


def _seeds(planned: Planned) -> str:
    """Return which seeds there are, in words."""
    seeds = planned.plan.each_seed
    if isinstance(seeds, range):
        return f"{len(seeds)}, {seeds[0]} to {seeds[-1]}" if len(seeds) > 1 else str(seeds[0])
    return ", ".join(map(str, seeds))


def _sources(planned: Planned, campaign: Path) -> tuple[Scenario | None, Sources]:
    """Return the scenario and the files that cases need."""
    plan = planned.plan
    scenario, file, text = None, Path(), b""
    if plan.scenario:
        beside = campaign.parent / plan.scenario
        file = beside if beside.is_file() else find_scenario(plan.scenario)
        scenario = read_scenario(file)[0]
        text = file.read_bytes()
    if ":" not in plan.stage:
        return scenario, Sources(str(file), text)
    name, _, function = plan.stage.rpartition(":")
    path = campaign.parent / name
    try:
        own = path.read_bytes()
    except OSError as error:
        raise UsageError(
            f"the file of the stage cannot be read ({error.strerror})", where=str(path), remedy="check stage"
        ) from None
    load_function(path, function, own)  # what is wrong is said before anything is done
    return scenario, Sources(str(file), text, f"{path}:{function}", own)


def _check(planned: Planned, scenario: Scenario | None, sources: Sources) -> None:
    """Refuse settings that no case could have, before anything is done."""
    stage, where = planned.plan.stage, planned.where
    if sources.function:
        return
    if stage not in KEYS:
        raise UsageError(
            f"stage '{stage}' is unknown",
            where=where,
            remedy=f"{nearest(stage, KEYS)} or name a function of your own as FILE.py:NAME",
        )
    if scenario is None:
        raise UsageError(f"stage '{stage}' needs a scenario", where=where, remedy="name one with scenario")
    names = {name.partition(".")[0] for name in (*planned.fixed, *planned.factors)}
    for name in sorted(names):
        if name not in KEYS[stage]:
            raise UsageError(
                f"stage '{stage}' has no setting '{name}'", where=where, remedy=nearest(name, KEYS[stage])
            )
    several = stage == "blend"
    for needed in ("at", "held_out") if several else ("at",):
        if needed not in names:
            raise UsageError(
                f"stage '{stage}' needs '{needed}'", where=where, remedy="state it in [fixed] or [vary]"
            )
    for at in _conditions(planned):
        scenario.reference_of(at)
    first = next(planned.settings)
    for name, values in planned.factors.items():
        for value in values:  # each value by itself, as combinations may be many
            try:
                _ = Case(scenario, {}, 0, nested({**first, name: value})).flown
            except UsageError as error:
                raise error.at(where) from None


def _conditions(planned: Planned) -> list[str]:
    """Return every condition that is flown."""
    found: list[str] = []
    for name in ("at", "held_out"):
        for value in planned.factors.get(name, [planned.fixed.get(name, [])]):
            found += [value] if isinstance(value, str) else list(value)
    return list(dict.fromkeys(found))


def _designs(planned: Planned, scenario: Scenario, file: Path, folder: Path) -> dict[str, MultisineDesign]:
    """Return the inputs of all conditions: those that state an excitation of their own have one."""
    if scenario.excitation is None:
        raise UsageError("section [excitation] is missing", where=str(file), remedy="add it")
    own = [at for at in _conditions(planned) if at in scenario.excitation.at]
    shared = [""] if len(own) < len(_conditions(planned)) else []
    inputs = [{"seed": 0, **({"at": at} if at else {})} for at in (*shared, *own)]
    paths = runner.run_units(
        units.design,
        inputs,
        folder / "design",
        scenario_sha256=scenario.sha256,
        suffix=".h5",
        beside={"scenario": str(file)},
    )
    return {at: read_design(path) for at, path in zip((*shared, *own), paths, strict=True)}
