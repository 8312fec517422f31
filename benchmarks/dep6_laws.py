"""Laws against advance ratio from twenty campaigns of dep6, judged by its truth.

``python benchmarks/dep6_laws.py [CAMPAIGNS] [FIRST] [ESTIMATOR]``, from the repository's root; by instruments
where no estimator is named. Each campaign is one flight of ``scenarios/dep6.toml`` with its own sensor noise
and gusts; manoeuvres are cut from it by `split_flight` and identified one by one, and laws are fitted to what
they tell. The truth is momentum theory, no exponential, linearised at the manoeuvres' means.

Writes ``benchmarks/dep6_laws.csv``, a row for each campaign, cluster and derivative:

form            of the law
unblown         C_inf, its standard error and the truth with stopped propellers
covered         share of the trims' advance ratios at which the 95 % interval of the law holds the truth
change          range of the truth over the trims, in median standard errors of a manoeuvre
bias            mean of local estimates less truth, in their standard errors
spread          standard deviation of the same
scatter         of the law, in median standard errors
manoeuvres      that the law is made from: those that cannot be identified are left out

and ``benchmarks/dep6_models.csv``, a row for each campaign and model: the misfit of held-out manoeuvres, two
trims of each cluster that none of the models is made from, per derivative (one: the manoeuvre's own error).
Semi-local models hold what the laws know better than the manoeuvres, or what the paper holds.
Campaigns that are in the files already are kept.
"""

from __future__ import annotations

import csv
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

import freqid as fq
from freqid.blend.semi_local.held import semi_local_model
from freqid.blend.semi_local.held_out import score_held_out
from freqid.blend.semi_local.one_shot import one_shot_model
from freqid.blend.semi_local.parametric import global_model
from freqid.blend.semi_local.problem import estimated_maneuvers
from freqid.core.channels import COEFFICIENT
from freqid.identify.advance_ratio.local import local_derivatives
from freqid.identify.advance_ratio.trim import excited
from freqid.simulate.local_coefficients import local_coefficients
from freqid.workflows.fly_trim_sequence import simulate_campaign

HERE = Path(__file__).parent
LAWS, MODELS = HERE / "dep6_laws.csv", HERE / "dep6_models.csv"
LAW_COLUMNS = ("campaign", "cluster_deg", "derivative", "form", "unblown", "std_error", "truth_unblown")
LAW_COLUMNS = (*LAW_COLUMNS, "covered", "change", "bias", "spread", "scatter", "manoeuvres")
MODEL_COLUMNS = (
    "campaign",
    "model",
    "misfit",
    "less_than_global",
    "less_than_global_std_error",
    "manoeuvres",
)
PUBLISHED = ("CZ.0", "Cm.0", "CY.beta", "Cl.da")  # that the paper holds; its CL is -CZ, its CS is CY
HELD_OUT = (2, 4)  # of a cluster's trims, in the order of their advance ratios


def truth_of(found, name):
    response, _, regressor = name.partition(".")
    return found[COEFFICIENT[response]]["bias" if regressor == "0" else regressor]


def flown(seed, estimator):
    """Return what one campaign's manoeuvres tell, and the truth at each."""
    flight = simulate_campaign("scenarios/dep6.toml", noise=1.0, turbulence=1.0, seed=seed)
    pieces = [excited(piece) for piece in fq.split_flight(flight.record)]
    points, told = [], []
    for i, piece in enumerate(pieces):
        try:
            points.append(fq.identify_point(piece, flight.scenario, estimator=estimator))
            told.append(piece)
        except fq.FreqidError as error:
            print(f"campaign {seed}, manoeuvre {i} is left out: {error}", flush=True)
    local = local_derivatives(points, [f"m{i:02d}" for i in range(len(points))])
    truths = [local_coefficients(flight.scenario, flight.truth.cut(p.time[0], p.time[-1])) for p in told]
    truth = np.array([[truth_of(found, name) for name in local.names] for found in truths])
    return local, truth


def law_rows(seed, local, truth):
    rows = []
    for cluster in global_model(local).clusters:
        at = [local.ids.index(i) for i in cluster.local.ids]
        for name, law in cluster.laws.items():
            k = local.place(name)
            here, error = truth[at, k], cluster.local.std_error[:, k]
            low, high = law.interval(cluster.local.advance_ratio)
            z = (cluster.local.estimate[:, k] - here) / error
            stopped = np.isinf(cluster.local.advance_ratio)
            rows.append(
                {
                    "campaign": seed,
                    "cluster_deg": f"{np.degrees(cluster.alpha):.2f}",
                    "derivative": name,
                    "form": law.form,
                    "unblown": f"{law.unblown:.5g}",
                    "std_error": f"{law.std_error:.3g}",
                    "truth_unblown": f"{here[stopped].mean():.5g}",
                    "covered": f"{np.mean((low <= here) & (here <= high)):.3f}",
                    "change": f"{np.ptp(here) / np.median(error):.3g}",
                    "bias": f"{z.mean():.3f}",
                    "spread": f"{z.std():.3f}",
                    "scatter": f"{law.scatter / np.median(error):.3f}",
                    "manoeuvres": law.points,
                }
            )
    return rows


def model_rows(seed, local):
    """Compare models on two trims of each cluster that they are not made from."""
    out = np.zeros(len(local.ids), dtype=bool)
    for cluster in np.unique(labels := _clusters(local)):
        members = np.flatnonzero(labels == cluster)
        order = members[np.argsort(local.advance_ratio[members])]
        out[order[list(HELD_OUT)]] = True
    used, held_out = local.of(~out), local.of(out)
    whole = global_model(used, clusters=int(labels.max()) + 1)
    problems = dict(zip(used.ids, estimated_maneuvers(used), strict=True))
    published = replace(semi_local_model(whole, problems, PUBLISHED), kind="semi-local, published")
    models = [whole, semi_local_model(whole, problems), published, one_shot_model(whole, problems)]
    judged = dict(zip(held_out.ids, estimated_maneuvers(held_out), strict=True))
    scores = score_held_out(models, held_out, judged)
    rows = []
    for model, misfit in scores.mean.items():
        less, error = scores.difference(model, "global")
        rows.append(
            {
                "campaign": seed,
                "model": model,
                "misfit": f"{misfit:.4f}",
                "less_than_global": f"{-less:.4f}",
                "less_than_global_std_error": f"{error:.4f}",
                "manoeuvres": len(held_out.ids),
            }
        )
    return rows


def _clusters(local):
    from freqid.identify.advance_ratio.clusters import cluster_alpha

    return cluster_alpha(local.alpha)


def kept(path):
    return list(csv.DictReader(path.open())) if path.exists() else []


def write(path, columns, rows):
    with path.open("w", newline="") as file:
        writer = csv.DictWriter(file, columns, lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)


CLEAR = ("CZ.0", "Cm.0", "Cm.qhat", "Cm.de", "CY.beta", "Cl.beta", "Cn.beta", "Cl.da")
"""That the paper calls clear; its CL and CS are -CZ and CY of stability axes."""
CHANGED, UNCHANGED = 8.0, 0.5  # standard errors of one manoeuvre: beyond doubt, and not to be seen


def summary(laws, models):
    covered = [float(r["covered"]) for r in laws]
    print(
        f"95 % intervals hold the truth at {100 * np.mean(covered):.1f} % of the trims of {len(covered)} laws"
    )
    clear = [r for r in laws if r["derivative"] in CLEAR]
    print(f"  of the clear derivatives {100 * np.mean([float(r['covered']) for r in clear]):.1f} %")
    for name in CLEAR:
        rows = [r for r in clear if r["derivative"] == name]
        share = [100 * float(r["std_error"]) / abs(float(r["unblown"])) for r in rows]
        off = [100 * (float(r["unblown"]) / float(r["truth_unblown"]) - 1) for r in rows]
        exponential = np.mean([r["form"] != "mean" for r in rows])
        print(
            f"  {name:8s} standard error of C_inf {np.median(share):.2f} % (largest {max(share):.2f} %), "
            f"off by {np.mean(off):+.2f} +- {np.std(off):.2f} %, "
            f"covered {np.mean([float(r['covered']) for r in rows]):.3f}, "
            f"exponential in {100 * exponential:.0f} %"
        )
    right = [r["form"] != "mean" for r in laws if float(r["change"]) > CHANGED]
    flat = [r["form"] == "mean" for r in laws if float(r["change"]) < UNCHANGED]
    print(
        f"form right in {100 * np.mean(right + flat):.1f} %: exponential in {100 * np.mean(right):.1f} % of "
        f"{len(right)} that change by more than {CHANGED:g} standard errors, mean in "
        f"{100 * np.mean(flat):.1f} % of {len(flat)} that change by less than {UNCHANGED:g}"
    )
    for model in dict.fromkeys(r["model"] for r in models):
        rows = [r for r in models if r["model"] == model]
        less = np.array([float(r["less_than_global"]) for r in rows])
        error = less.std(ddof=1) / np.sqrt(less.size) if less.size > 1 else np.nan
        print(
            f"{model:22s} misfit of held-out manoeuvres {np.mean([float(r['misfit']) for r in rows]):.3f}, "
            f"less than global by {less.mean():+.3f} +- {error:.3f}, in {np.sum(less > 0)} of {less.size} "
            "campaigns"
        )


def main():
    count, first = (int(a) for a in (*sys.argv[1:3], *("20", "1")[len(sys.argv[1:3]) :]))
    estimator = sys.argv[3] if len(sys.argv) > 3 else "instruments"
    for seed in range(first, first + count):
        laws, models = kept(LAWS), kept(MODELS)
        if any(int(r["campaign"]) == seed for r in laws):
            continue
        local, truth = flown(seed, estimator)
        laws, models = [*kept(LAWS), *law_rows(seed, local, truth)], [*models, *model_rows(seed, local)]
        write(LAWS, LAW_COLUMNS, laws)
        write(MODELS, MODEL_COLUMNS, models)
        print(f"campaign {seed}", flush=True)
    summary(kept(LAWS), kept(MODELS))


if __name__ == "__main__":
    main()
