"""``freqid score``: a flight held against the prediction that was sealed before it."""

from __future__ import annotations

from pathlib import Path

import click

from freqid.cli import options
from freqid.cli.options import FILE


@click.command("score")
@click.argument("prediction", type=FILE)
@click.argument("record", type=FILE)
@options.output("the record's name with -score.h5")
@click.option("--scenario", type=FILE, help="Describes the vehicle, where the record does not.")
@click.option(
    "--gate",
    type=click.FloatRange(min=0, max=1),
    default=0.85,
    show_default=True,
    help="Lowest share of samples in the bands, over the channels of each kind.",
)
@options.page_option("flight and bands")
@options.as_json
def command(
    prediction: Path,
    record: Path,
    destination: Path | None,
    scenario: Path | None,
    gate: float,
    page: bool,
    json_: bool,
) -> None:
    """Tell how often RECORD stayed in the bands of PREDICTION, and which assumption failed.

    Refuses a prediction that was edited after it was sealed, a record of another design, and one that was
    there before the prediction. Exit code 4 where the gate is missed.
    """
    from freqid.cli.prediction_texts import score_result, score_text
    from freqid.core.errors import GateFailed
    from freqid.views.page import page as page_of
    from freqid.workflows.files import save
    from freqid.workflows.models.seal import score_prediction

    destination = destination or record.with_name(f"{record.stem}-score.h5")
    drawn = options.page_beside(destination, page, prediction, record, scenario)
    score = score_prediction(prediction, record, scenario, gate=gate)
    save(score, destination)
    if drawn:
        page_of(score).save(drawn)
    options.emit(json_, score_result(score), f"{score_text(score)}\n{options.written(destination, drawn)}")
    if not score.passed:
        kind, share = min(score.coverage.items(), key=lambda item: item[1])
        raise GateFailed(
            f"{100 * share:.1f} % of the {kind} samples are in the bands, the gate is {100 * gate:g} %",
            where=str(record),
            remedy=f"failed assumptions: {', '.join(score.failed) or 'none that a record tells'}",
        )
