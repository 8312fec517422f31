"""From a log to a report: a flight is imported, identified, used to predict another, and reported.

With the Twin Otter records beside the project these are real flights; otherwise the linear aircraft flies.
Run as ``python examples/log_to_report.py``.
"""

from __future__ import annotations

from pathlib import Path

import freqid as fq

PROJECT = Path(__file__).resolve().parents[1]
FLIGHTS = PROJECT.parent / "shared" / "data" / "sidpac"
OUT = PROJECT / "reports" / "log"


def flights() -> tuple[fq.Scenario, list[fq.FlightRecord]]:
    """Return two flights and what describes their vehicle: real ones where they are at hand."""
    if FLIGHTS.is_dir():
        scenario = fq.read_scenario(PROJECT / "scenarios" / "twin_otter.toml")
        logs = [FLIGHTS / f"totter_{name}_data.mat" for name in ("f1_017", "f1_014")]
        return scenario, [fq.read_log(log, scenario=scenario) for log in logs]
    from linear_record import fly

    scenario = fq.read_scenario(PROJECT / "scenarios" / "linear.toml")
    columns = PROJECT / "scenarios" / "maps" / "linear.toml"
    records = []
    for seed in (1, 2):
        log = OUT / f"linear-{seed}.csv"
        log.parent.mkdir(parents=True, exist_ok=True)
        fly(seed=seed).to_csv(log, index=False, float_format="%.10g")
        records.append(fq.read_log(log, columns=columns, scenario=scenario, at="u20"))
    return scenario, records


def main() -> None:
    """Run the chain on real flights where they are at hand, else on simulated ones."""
    scenario, (flight, other) = flights()
    model = fq.identify_point(flight, scenario, held_out=other)
    print(model)  # noqa: T201
    for name, fit in model.prediction.items():
        print(f"{name}: R2 {model[name].r2:.3f}, of the flight that was not used {fit.r2:.3f}")  # noqa: T201
    fq.save(model, OUT / "point.h5")
    page = fq.page(model, record=flight, scenario=scenario).save(OUT / "report.html")
    print(f"The report is {page}")  # noqa: T201


if __name__ == "__main__":
    main()
