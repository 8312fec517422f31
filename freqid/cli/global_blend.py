"""``freqid global-blend``: point models along the corridor, or at many advance ratios, become one model."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from freqid.cli.options import FILE, as_json, emit, names, page_beside, page_option, parsed, sigma, written
from freqid.core.errors import UsageError


@click.command("global-blend")
@click.argument("points", nargs=-1, required=True, type=FILE)
@click.option("-o", "--output", "destination", type=FILE, required=True, help="Global model.")
@click.option(
    "--by",
    type=click.Choice(["corridor", "advance-ratio"]),
    default="corridor",
    show_default=True,
    help="Blend over speed and tilt, or fit laws of the propellers' advance ratio.",
)
@click.option(
    "--densities",
    type=click.Choice(["apart", "together"]),
    help="Of the corridor: a line for each air density, as without it, or all points on one line in "
    "equivalent speed.",
)
@click.option(
    "--along",
    help="Of the corridor: what it runs along: u, or a variable that the references set; without it, "
    "speed, or if all points have the same, the first of these that varies.",
)
@click.option(
    "--predict", "held_out", type=FILE, help="Of the corridor: a record that no point is made from."
)
@click.option(
    "--outside",
    type=click.Choice(["refuse", "hold"]),
    help="What to do where that record leaves the corridor; it is refused without it.",
)
@click.option(
    "--kind",
    type=click.Choice(["global", "semi-local", "one-shot"]),
    help="Of advance ratio: laws through the estimates, as without it; after some derivatives were held "
    "at them; or from all manoeuvres at once.",
)
@click.option("--clusters", type=click.IntRange(min=1), help="Of advance ratio: clusters of trim alpha.")
@click.option(
    "--hold", callback=parsed(names), help="Of a semi-local model: derivatives that it holds, as Cm.0,CZ.0."
)
@click.option(
    "--sensor-error",
    multiple=True,
    callback=parsed(sigma("--sensor-error", "V=0.05")),
    help="Of advance ratio: one sigma of a constant error that all manoeuvres share, as V=0.05 (m/s) or "
    "alpha=0.002 (rad).",
)
@click.option(
    "--held-out", "judged", multiple=True, type=FILE, help="Of advance ratio: a point to judge all kinds by."
)
@page_option("the model")
@as_json
def command(
    points: tuple[Path, ...],
    destination: Path,
    by: str,
    held_out: Path | None,
    page: bool,
    json_: bool,
    **asked: Any,
) -> None:
    """Blend POINTS, models of identify-point, into one model.

    Over the transition corridor, points of several densities are tested for agreement after similarity has
    carried one to the other. By advance ratio, each derivative is a mean, one or two exponentials of J in
    each cluster of trim angles of attack.
    """
    drawn = page_beside(destination, page, *points, held_out, *asked["judged"])
    of = {
        "corridor": ("densities", "along", "outside"),
        "advance-ratio": ("kind", "clusters", "hold", "sensor_error"),
    }
    foreign = next(names for kind, names in of.items() if kind != by) + (
        ("judged",) if by == "corridor" else ()
    )
    given = [name for name in foreign if asked[name]] + (["predict"] if by != "corridor" and held_out else [])
    if given:
        option = {"judged": "held-out"}.get(given[0], given[0].replace("_", "-"))
        raise UsageError(
            f"--{option} does not go with --by {by}", remedy=f"leave it out, or change --by (it is {by})"
        )
    if by == "corridor":
        _corridor(points, destination, held_out, drawn, asked, json_)
    else:
        _advance_ratio(points, destination, drawn, asked, json_)


def _corridor(
    points: tuple[Path, ...],
    destination: Path,
    held_out: Path | None,
    drawn: Path | None,
    asked: dict[str, Any],
    json_: bool,
) -> None:
    from freqid.blend.consistency import density_agreement
    from freqid.cli.blend_texts import blend_result, blend_table
    from freqid.views.page import page as page_of
    from freqid.workflows.files import save
    from freqid.workflows.models.blend import blend, predict

    model = blend(points, densities=asked["densities"] or "apart", along=asked["along"] or "")
    outside = asked["outside"] or "refuse"
    predicted = predict(model, held_out, outside=outside) if held_out else {}
    found = (model.corridor, density_agreement(model), predicted)
    save(model, destination)
    if drawn:
        page_of(model, record=held_out, outside=outside).save(drawn)
    emit(json_, blend_result(*found), f"{blend_table(*found)}\n{written(destination, drawn)}")


def _advance_ratio(
    points: tuple[Path, ...], destination: Path, drawn: Path | None, asked: dict[str, Any], json_: bool
) -> None:
    from freqid.cli.advance_ratio_texts import advance_ratio_result, advance_ratio_table
    from freqid.views.page import page as page_of
    from freqid.workflows.files import save
    from freqid.workflows.models.advance_ratio import blend_by_advance_ratio, compare_held_out

    model = blend_by_advance_ratio(
        points,
        kind=asked["kind"] or "global",
        clusters=asked["clusters"],
        hold=asked["hold"],
        sensor_errors=dict(asked["sensor_error"]),
    )
    save(model, destination)
    if drawn:
        page_of(model).save(drawn)
    scores = None
    if asked["judged"]:
        scores = compare_held_out(points, asked["judged"], clusters=asked["clusters"], hold=asked["hold"])
    text = f"{advance_ratio_table(model, scores)}\n{written(destination, drawn)}"
    emit(json_, advance_ratio_result(model, scores), text)
