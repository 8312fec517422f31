"""``freqid design-inputs``: a scenario becomes a set of orthogonal multisines, a page and a test card."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from freqid.cli.options import as_json, emit, keep_inputs, output

if TYPE_CHECKING:
    from freqid.core.design import MultisineDesign
    from freqid.core.scenario import Scenario
    from freqid.design.closed_loop import ClosedLoop
    from freqid.design.excursions import Excursions
    from freqid.design.forecast import Forecast
    from freqid.design.multisine import Merit

VARIED_MODELS = 12  # drawn from the model's covariance, for the spread of expected excursions
STUDIED_PERIODS = (40.0, 60.0, 80.0, 100.0, 120.0)  # s, the range of the LA-8 study


@dataclass(frozen=True)
class Prediction:
    """What a point model says about a design: accuracy (where noise is stated), motion, spread, trim."""

    forecast: Forecast | None = None
    motion: Excursions | None = None
    varied: tuple[Excursions, ...] = ()
    trim: dict[str, float] = field(default_factory=dict)


@click.command("design-inputs")
@click.argument("scenario", type=click.Path(path_type=Path))
@output("design.h5 in reports/")
@click.option("--seed", type=int, default=0, show_default=True, help="The same seed gives the same design.")
@click.option(
    "--model", type=click.Path(path_type=Path), help="Point model, to forecast accuracy and motion."
)
@click.option("--study/--no-study", default=True, help="Compare periods of 40 to 120 s on the page.")
@click.option("--page/--no-page", default=True, help="Write the page and the test card beside the design.")
@click.option("--csv", "csv_", is_flag=True, help="Also write the samples as CSV.")
@click.option("--mat", is_flag=True, help="Also write the samples as a MATLAB file.")
@click.option("--c-header", is_flag=True, help="Also write a C header that evaluates the signals.")
@click.option("--lua", is_flag=True, help="Also write a Lua table that evaluates the signals.")
@as_json
def command(
    scenario: Path,
    destination: Path | None,
    seed: int,
    model: Path | None,
    study: bool,
    page: bool,
    csv_: bool,
    mat: bool,
    c_header: bool,
    lua: bool,
    json_: bool,
) -> None:
    """Design orthogonal, phase-optimised multisines for the effectors of SCENARIO.

    Writes DESIGN.h5 and beside it a page with all plots, and a test card as text and HTML.
    """
    from dataclasses import replace

    from tqdm import tqdm

    from freqid.core.design_file import write_design
    from freqid.core.errors import FreqidError, UsageError
    from freqid.core.scenario import read_scenario
    from freqid.design import export
    from freqid.design.multisine import design_multisines, merit, sampled, with_low_net_loads

    described, sha256 = read_scenario(scenario)
    if described.excitation is None:
        raise UsageError("section [excitation] is missing", where=str(scenario), remedy="add it")
    destination = destination or Path("reports") / "design.h5"
    keep_inputs(destination, scenario, model)

    def made(period_s: float, what: str) -> MultisineDesign:
        assert described.excitation is not None
        import msgspec

        excitation = msgspec.structs.replace(described.excitation, period_s=period_s)
        with tqdm(desc=what, unit="signal", disable=None, leave=False) as bar:

            def progress(done: int, total: int) -> None:
                bar.total = total
                bar.update(done - bar.n)

            return design_multisines(excitation, described.effector, seed=seed, progress=progress)

    try:
        searched = design = made(described.excitation.period_s, "signals")
        if described.excitation.net_load:
            design = with_low_net_loads(searched, described.excitation, described.effector)
    except UsageError as error:
        raise error.at(str(scenario)) from None
    sources = {"scenario": {"file": str(scenario), "sha256": sha256}, "seed": seed}
    design = replace(design, provenance=sources)
    judged, inputs = merit(design), sampled(design)
    predicted = _predict(model, design, described) if model else None

    write_design(destination, design, inputs.time, inputs.values, sha256)
    written = [destination]
    for wanted, suffix, write in (
        (csv_, ".csv", lambda path: export.write_csv(path, inputs)),
        (mat, ".mat", lambda path: export.write_mat(path, inputs)),
        (c_header, ".h", lambda path: export.write_c_header(path, design)),
        (lua, ".lua", lambda path: export.write_lua(path, design)),
    ):
        if wanted:
            written.append(destination.with_suffix(suffix))
            write(written[-1])
    if page:
        others = []
        for period in STUDIED_PERIODS if study else ():
            try:
                others.append(made(period, f"study of T = {period:g} s"))
            except FreqidError:  # a period too short for so many effectors is no fault of the design
                continue
        written += _pages(destination, (searched, design), judged, described, others, predicted)
    emit(json_, _for_machines(design, judged, written), _table(design, judged, written))


def _predict(path: Path, design: MultisineDesign, described: Scenario) -> Prediction:
    """Return what a point model says that the design will do and buy."""
    from freqid.core.errors import UsageError
    from freqid.core.point_file import read_point
    from freqid.design.excursions import excursions
    from freqid.design.forecast import forecast
    from freqid.design.rigid_body import close_loop, derivatives_of, drawn_derivatives

    point, vehicle = read_point(path), described.aircraft()
    trim = {
        name: float(value)
        for response in point.responses.values()
        for name, value in zip(response.regressors, response.trim, strict=True)
    }

    def closed(derivatives: dict[str, dict[str, float]]) -> ClosedLoop:
        return close_loop(
            derivatives,
            vehicle,
            u=point.reference.u,
            gains=described.control.get("gains"),
            trim={n: v for n, v in trim.items() if n in vehicle.effector_kinds},
        )

    loop = closed(derivatives_of(point))
    watched = ("u", "v", "w", "p", "q", "r", "phi", "theta", *design.names)
    motion = excursions(design, loop, watched)
    varied = []
    for derivatives in drawn_derivatives(point, VARIED_MODELS, design.seed):
        try:
            varied.append(excursions(design, closed(derivatives), watched))
        except UsageError:  # a draw that is unstable says that the spread is at least this wide
            continue
    noise = {**described.noise}
    for effector in vehicle.effectors:
        if effector.kind in noise:
            noise.setdefault(effector.name, noise[effector.kind])
    expected = None
    if noise and described.identification is not None:
        expected = forecast(design, loop, described.identification, noise)
    return Prediction(expected, motion, tuple(varied), trim)


def _pages(
    destination: Path,
    before_after: tuple[MultisineDesign, MultisineDesign],
    judged: Merit,
    described: Scenario,
    others: list[MultisineDesign],
    predicted: Prediction | None,
) -> list[Path]:
    import hashlib

    import numpy as np

    from freqid.core.channels import WRENCH
    from freqid.design.multisine import effectiveness, excited, merit, truncated
    from freqid.design.net_load import net_loads
    from freqid.report.design_page import write_design_page
    from freqid.report.flight_plan import FlightPlan
    from freqid.report.rendering import write_text
    from freqid.report.test_card import build_card, test_card_text, write_test_card

    searched, design = before_after
    excitation = described.excitation
    assert excitation is not None
    predicted = predicted or Prediction()
    vehicle = described.aircraft()
    plan = FlightPlan(
        vehicle=vehicle,
        trim={n: v for n, v in predicted.trim.items() if n in vehicle.effector_kinds},
        source=destination.name,
        sha256=hashlib.sha256(destination.read_bytes()).hexdigest(),
        forbidden_hz=excitation.forbidden_hz,
        fade_s=excitation.fade_s,
        abort=excitation.abort,
        control="gains of [control]" if described.control.get("gains") else "",
        motion=predicted.motion,
        varied=predicted.varied,
    )
    loads = effectiveness(excited(excitation, described.effector))
    net = None
    if excitation.net_load:
        counted = np.array([axis in excitation.net_load for axis in WRENCH])
        axes = [axis for axis, wanted in zip(WRENCH, counted, strict=True) if wanted]
        after, before = (net_loads(s, loads[counted]) for s in (design.signals, searched.signals))
        net = (axes, after, before)
    page = destination.with_suffix(".html")
    card = destination.with_name(f"{destination.stem}-card.txt")
    study = [(merit(other), truncated(other)) for other in others]
    write_design_page(
        page, design, judged, truncated(design), plan=plan, net=net, study=study, forecast=predicted.forecast
    )
    test_card = build_card(design, judged, plan)
    write_text(card, test_card_text(test_card))
    write_test_card(card.with_suffix(".html"), test_card)
    return [page, card, card.with_suffix(".html")]


def _for_machines(design: MultisineDesign, judged: Merit, written: list[Path]) -> dict[str, Any]:
    return {
        "effectors": {
            signal.name: {
                "rpf": float(judged.rpf[i]),
                "rms": float(judged.rms[i]),
                "peak": float(judged.peak[i]),
                "slew": float(judged.slew[i]),
                "units": signal.unit,
                "harmonics": signal.index.tolist(),
            }
            for i, signal in enumerate(design.signals)
        },
        "max_correlation": judged.max_correlation,
        "condition_number": judged.condition_number,
        "files": [str(path) for path in written],
    }


def _table(design: MultisineDesign, judged: Merit, written: list[Path]) -> str:
    import numpy as np

    lines = [f"{'effector':<10} {'RPF':>6} {'rms':>10} {'peak':>10} {'slew /s':>10}  unit   harmonics of 1/T"]
    for i, signal in enumerate(design.signals):
        lines.append(
            f"{signal.name:<10} {judged.rpf[i]:>6.3f} {judged.rms[i]:>10.4g} {judged.peak[i]:>10.4g} "
            f"{judged.slew[i]:>10.4g}  {signal.unit:<6} {' '.join(map(str, signal.index))}"
        )
    low, middle, high = np.quantile(judged.rpf, [0, 0.5, 1])
    lines.append(
        f"RPF min/median/max {low:.3f}/{middle:.3f}/{high:.3f}, largest correlation "
        f"{judged.max_correlation:.1e}, condition number {judged.condition_number:.6f}"
    )
    return "\n".join([*lines, *map(str, written)])
