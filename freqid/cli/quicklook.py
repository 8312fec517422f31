"""``freqid quicklook``: a log held against its design, minutes after landing."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from freqid.cli import options
from freqid.cli.options import FILE

if TYPE_CHECKING:
    from freqid.core.results.quicklook import Quicklook

_WORST = 8  # parameters in the text


@click.command("quicklook")
@click.argument("log", type=FILE)
@click.argument("design", type=FILE)
@click.option("--scenario", type=FILE, help="Limits of the effectors, and the regressors to judge.")
@click.option(
    "--map", "columns", type=FILE, help="TOML map of columns to channels, for a log that needs one."
)
@click.option("--resample", "resample_hz", type=float, help="Put all channels of a log on this rate, Hz.")
@click.option("--at", default="", help="Id of the reference condition that was flown.")
@click.option(
    "--accuracy",
    type=click.FloatRange(min=0, min_open=True),
    default=0.2,
    show_default=True,
    help="Standard error over the estimate that a parameter is asked for.",
)
@options.output("the log's name with -quicklook.h5")
@options.page_option("the inputs")
@options.as_json
def command(
    log: Path,
    design: Path,
    destination: Path | None,
    page: bool,
    json_: bool,
    **asked: Any,
) -> None:
    """Tell whether LOG, flown with DESIGN, is usable or must be repeated, and why.

    Looks for the injection, its start, what effectors achieved of their commands, saturation, log rates and
    the accuracy of the parameters so far. Exit code 4 where the flight must be repeated.
    """
    from freqid.core.errors import GateFailed, UsageError
    from freqid.views.page import page as page_of
    from freqid.workflows.files import save
    from freqid.workflows.quicklook import quicklook

    destination = destination or log.with_name(f"{log.stem}-quicklook.h5")
    drawn = destination.with_suffix(".html")
    files = [destination, drawn] if page else [destination]
    if destination == drawn:
        raise UsageError(
            "the result is no page; the page is written beside it",
            where=str(destination),
            remedy=f"write -o {destination.with_suffix('.h5')}",
        )
    options.keep_inputs(files, log, design, asked["scenario"], asked["columns"])
    look = quicklook(log, design, **asked)
    save(look, destination, scenario=asked["scenario"])
    if page:
        page_of(look).save(drawn)
    text = quicklook_text(look)
    options.emit(json_, quicklook_result(look), "\n".join([text, *map(str, files)]))
    if not look.usable:
        raise GateFailed(
            f"repeat, because {'; '.join(look.reasons)}",
            where=str(log),
            remedy="what was found is written all the same",
        )


def quicklook_result(look: Quicklook) -> dict[str, Any]:
    """Return a quick look for machines; what is not known is null."""
    return {
        "verdict": look.verdict,
        "reasons": list(look.reasons),
        "remarks": list(look.remarks),
        "start_s": _known(look.start_s),
        "likeness": look.likeness,
        "inputs": {
            i.name: {
                "present": i.present,
                "source": i.source,
                "coherence": i.coherence,
                "gain": i.gain,
                "found_on": i.found_on,
                "periods": i.periods,
                "achieved_gain": _known(i.achieved_gain),
                "achieved_lag_s": _known(i.achieved_lag_s),
                "achieved_coherence": _known(i.achieved_coherence),
                "at_limit": _known(i.at_limit),
                "at_rate_limit": _known(i.at_rate_limit),
            }
            for i in look.inputs
        },
        "rates_hz": {r.channel: r.rate_hz for r in look.rates},
        "accuracy": look.accuracy,
        "parameters": [
            {
                "response": p.response,
                "parameter": p.name,
                "unit": p.unit,
                "estimate": p.estimate,
                "std_error": p.std_error,
                "contribution_error": _known(p.contribution_error),
                "met": p.met,
            }
            for p in look.parameters
        ],
        "plausibility": dict(look.plausibility),
    }


def quicklook_text(look: Quicklook) -> str:
    """Return a quick look for people."""
    lines = [look.sentence[:1].upper() + look.sentence[1:]]
    if math.isfinite(look.start_s):
        lines.append(f"The design starts at {look.start_s:.3f} s on the log's clock.")
    lines.append("")
    lines.append(
        f"{'input':<12}{'found':>8}{'of design':>11}{'achieved':>10}{'lag ms':>8}{'limit':>8}{'rate':>8}"
    )
    lines += [
        f"{i.name:<12}{i.coherence:>8.3f}{i.gain:>11.3f}{_plain(i.achieved_gain, '.3f'):>10}"
        f"{_plain(1e3 * i.achieved_lag_s, '.0f'):>8}{_plain(100 * i.at_limit, '.1f', ' %'):>8}"
        f"{_plain(100 * i.at_rate_limit, '.1f', ' %'):>8}"
        for i in look.inputs
    ]
    rates = sorted({round(r.rate_hz, 3) for r in look.rates})
    lines += ["", f"Rates of the log: {', '.join(f'{rate:g}' for rate in rates)} Hz."]
    if look.parameters:
        met = sum(p.met for p in look.parameters)
        lines.append(f"Parameters that met {look.accuracy:.0%}: {met} of {len(look.parameters)}.")
        worst = sorted(look.parameters, key=lambda p: (p.met, -p.contribution_error))[:_WORST]
        lines += [
            f"  {p.response} by {p.name:<8}{p.estimate:>12.4g} +- {p.std_error:<10.2g} {p.unit}"
            f"{'' if p.met else '  not met'}"
            for p in worst
            if not p.met
        ]
    lines += [f"note: {remark}." for remark in look.remarks]
    return "\n".join(lines)


def _known(value: float) -> float | None:
    return value if math.isfinite(value) else None


def _plain(value: float, form: str, unit: str = "") -> str:
    return f"{value:{form}}{unit}" if math.isfinite(value) else "-"
