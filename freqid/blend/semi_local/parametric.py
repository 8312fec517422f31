"""The parametric global model: laws through the local estimates of every cluster of trims."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from freqid.core.errors import DataError
from freqid.core.results.advance_ratio import (
    AdvanceRatioLaw,
    AdvanceRatioModel,
    LocalDerivatives,
    TrimCluster,
)
from freqid.identify.advance_ratio.clusters import cluster_alpha
from freqid.identify.advance_ratio.law import count_trims, fit_law


def fit_laws(
    local: LocalDerivatives, held: Mapping[str, AdvanceRatioLaw] | None = None
) -> dict[str, AdvanceRatioLaw]:
    """Fit the laws of all derivatives of one cluster.

    Parameters
    ----------
    local : LocalDerivatives
        Of its manoeuvres.
    held : mapping of str to AdvanceRatioLaw, optional
        Laws that are kept as they are.

    Returns
    -------
    dict of str to AdvanceRatioLaw
        Without derivatives that no manoeuvre of the cluster tells.
    """
    laws = {}
    std_error = local.std_error
    for j, (name, unit) in enumerate(zip(local.names, local.units, strict=True)):
        told = np.isfinite(local.estimate[:, j])
        if held and name in held:
            laws[name] = held[name]
        elif told.any():
            laws[name] = fit_law(
                local.advance_ratio[told], local.estimate[told, j], std_error[told, j], name, unit
            )
    return laws


def global_model(
    local: LocalDerivatives,
    *,
    clusters: int | None = None,
    vehicle: str = "",
    provenance: Mapping[str, Any] | None = None,
) -> AdvanceRatioModel:
    """Make the global model: cluster the trims, and fit a law to each derivative of each cluster.

    Parameters
    ----------
    local : LocalDerivatives
    clusters : int, optional
        Number of clusters of trim angle of attack; found from the trims where absent.
    vehicle : str
    provenance : mapping, optional
        JSON-compatible.

    Returns
    -------
    AdvanceRatioModel
        Its remarks say where trims are too few to tell a law, or the unblown limit is extrapolated.

    Raises
    ------
    DataError
        Where there is no manoeuvre.
    UsageError
        Where so many clusters cannot be made.
    """
    if not local.ids:
        raise DataError("there is no manoeuvre to make laws from", remedy="identify some")
    labels = cluster_alpha(local.alpha, clusters)
    made = []
    for k in range(labels.max() + 1):
        members = local.of(labels == k)
        made.append(TrimCluster(members, fit_laws(members)))
    return AdvanceRatioModel(
        clusters=tuple(made),
        vehicle=vehicle,
        provenance=dict(provenance or {}),
        remarks=tuple(r for cluster in made for r in _remarks(cluster)),
    )


def _remarks(cluster: TrimCluster) -> list[str]:
    """Return what a reader should know of one cluster: sentences, not one for each derivative."""
    at = f"At {np.degrees(cluster.alpha):.3g} deg trim angle of attack"
    finite = np.sort(cluster.local.advance_ratio[np.isfinite(cluster.local.advance_ratio)])
    stopped = bool(np.isinf(cluster.local.advance_ratio).any())
    trims = count_trims(finite) + stopped
    if trims == 1:
        where = "stopped propellers" if stopped else f"an advance ratio of {finite.mean():.3g}"
        return [
            f"{at} all {len(cluster.local.ids)} manoeuvres are of one trim, {where}: how derivatives change "
            "with blowing cannot be told, and each law is a mean; fly more advance ratios."
        ]
    remarks = []
    few = sorted({r.partition(": ")[2] for law in cluster.laws.values() for r in law.remarks})
    remarks += [f"{at}, {sentence}" for sentence in few]
    extrapolated = [name for name, law in cluster.laws.items() if not law.reaches_unblown]
    if len(extrapolated) == len(cluster.laws):
        remarks.append(
            f"{at} no manoeuvre has stopped propellers: the unblown limit is extrapolated from advance "
            f"ratios up to {finite[-1]:.3g}; fly in the glide."
        )
    elif extrapolated:
        remarks.append(
            f"{at} no manoeuvre with stopped propellers tells {' '.join(extrapolated)}: their unblown limits "
            "are extrapolated."
        )
    return remarks
