"""One self-contained page about a study: the whole chain of a scenario at several conditions."""

from __future__ import annotations

import numpy as np

from freqid import __version__
from freqid.blend.campaign import HeldOut, StudiedPoint, StudyResults
from freqid.design.signals import sample, samples_per_period
from freqid.report import design_figures, study_tables
from freqid.report.effectors import groups_of
from freqid.report.pictures import Picture, picture
from freqid.report.rendering import render
from freqid.report.signal_pictures import signal_pictures
from freqid.report.study_corridor_pictures import error_pictures, parameter_pictures, remaining_pictures
from freqid.report.study_pictures import (
    convergence_pictures,
    fit_pictures,
    history_pictures,
    several_pictures,
)
from freqid.report.study_verdict import MOST_HELD_OUT, MOST_NEW_DENSITY, MOST_VALIDATION, study_verdict

__all__ = ["HeldOut", "StudiedPoint", "StudyResults", "build_study_page"]

_POINTS = 16  # samples per shortest period: drawn, not judged


def build_study_page(results: StudyResults) -> str:
    """Return the page of a study: one HTML text that fetches nothing, the same for the same results.

    Parameters
    ----------
    results : StudyResults
    """
    followed = results.followed()
    middle = followed[len(followed) // 2]
    others = [p for p in followed if p is not middle]
    return render(
        "study.html",
        title=results.vehicle.name or "Unnamed vehicle",
        count=len(results.points),
        version=__version__,
        findings=study_verdict(results),
        facts=study_tables.facts(results),
        heads=study_tables.heads(results),
        conditions=study_tables.condition_rows(results),
        errors=study_tables.error_rows(results),
        differing=study_tables.differing_rows(results),
        parameters=sum(len(middle.model[r].regressors) for r in results.responses),
        noise_known=any(r.r2_ceiling is not None for p in results.points for r in p.model.responses.values()),
        linearised=any(p.linear for p in results.points),
        most_validation=MOST_VALIDATION,
        error_pictures=error_pictures(results),
        corridor=parameter_pictures(results),
        remaining=remaining_pictures(results),
        blended=results.model is not None,
        held_out=study_tables.held_out_rows(results),
        most_held_out=MOST_HELD_OUT,
        most_new_density=MOST_NEW_DENSITY,
        shown=middle.id,
        fits=[*fit_pictures(results, middle), *several_pictures(results)],
        other_fits=[{"id": p.id, "pictures": fit_pictures(results, p)} for p in others],
        convergence=convergence_pictures(results),
        histories=history_pictures(results, middle),
        other_histories=[{"id": p.id, "pictures": history_pictures(results, p)} for p in others if p.history],
        inputs=_inputs(results),
        provenance={**results.design.provenance, **results.provenance},
    )


def _inputs(results: StudyResults) -> list[Picture]:
    """Draw the spectra of all effectors and their signals over one period."""
    design, vehicle = results.design, results.vehicle
    index = np.concatenate([s.index for s in design.signals])
    samples = samples_per_period(index, _POINTS)
    time = np.linspace(0.0, design.period_s, samples + 1)
    values = np.array([sample(s.index, s.amplitude, s.phase, samples) for s in design.signals])
    values = np.append(values, values[:, :1], axis=1)  # a period ends as it starts
    spectra = picture(
        design_figures.harmonic_map(design, groups_of(design.names, vehicle), ()),
        "spectra",
        "Spectra of all effectors, and which effector has which harmonic",
        f"{len(design.signals)} effectors at once. A line that one effector has alone tells its effect from "
        "all others.",
    )
    when = f"one period of {design.periods}"
    return [spectra, *signal_pictures(design, vehicle, time, values, when, "Each group has one scale.")]
