"""``freqid import-log``: a log of another tool becomes a flight record."""

from __future__ import annotations

from pathlib import Path

import click

from freqid.cli.options import as_json, emit, keep_inputs, output


@click.command("import-log")
@click.argument("log", type=click.Path(path_type=Path))
@output("the log's name with .h5, in reports/")
@click.option("--map", "map_path", type=click.Path(path_type=Path), help="TOML map of columns to channels.")
@click.option("--scenario", type=click.Path(path_type=Path), help="Scenario that describes the vehicle.")
@click.option("--at", "reference", default="", help="Id of the reference condition that was flown.")
@click.option("--resample", "rate_hz", type=float, help="Put all channels on this rate, Hz.")
@click.option("--cut", help="Keep START:STOP, seconds on the log's clock, for example 12.5:72.5.")
@click.option("--split", is_flag=True, help="Find the manoeuvres and write each to NAME-1.h5, NAME-2.h5, ...")
@as_json
def command(
    log: Path,
    destination: Path | None,
    map_path: Path | None,
    scenario: Path | None,
    reference: str,
    rate_hz: float | None,
    cut: str | None,
    split: bool,
    json_: bool,
) -> None:
    """Read LOG (CSV, MATLAB, SIDPAC columns) and write a flight record.

    Units are converted to SI, time is checked to be uniform, and nothing is resampled unless asked.
    """
    from dataclasses import replace

    from freqid.core.errors import DataError
    from freqid.core.record import parse_span, write_record
    from freqid.core.scenario import read_scenario
    from freqid.flightlog.cut import find_maneuvers
    from freqid.flightlog.read import read_log

    described, sha256 = read_scenario(scenario) if scenario else (None, "")
    vehicle = described.aircraft() if described else None
    if described and reference:
        described.reference_of(reference)
    span = None if cut is None else parse_span(cut)
    record = read_log(log, map_path, cut=span, resample_hz=rate_hz, vehicle=vehicle)
    if reference:
        record = replace(record, reference=reference)

    destination = destination or Path("reports") / f"{log.stem}.h5"
    pieces = {destination: record}
    if split:
        spans = find_maneuvers(record)
        if not spans:
            raise DataError("no manoeuvre was found", where=str(log), remedy="cut it by hand with --cut")
        pieces = {
            destination.with_name(f"{destination.stem}-{i}{destination.suffix}"): record.cut(*span)
            for i, span in enumerate(spans, start=1)
        }
    for path in pieces:
        keep_inputs(path, log, map_path, scenario)
    for path, piece in pieces.items():
        write_record(path, piece, sha256)

    emit(
        json_,
        {
            "records": [
                {
                    "path": str(path),
                    "start_s": float(piece.time[0]),
                    "duration_s": piece.duration,
                    "rate_hz": 1 / piece.dt,
                    "samples": piece.time.size,
                    "channels": {n: {"units": c.unit, "source": c.source} for n, c in piece.channels.items()},
                }
                for path, piece in pieces.items()
            ]
        },
        "\n".join(
            f"{path}: {len(piece.channels)} channels, {piece.duration:.6g} s at {1 / piece.dt:.6g} Hz"
            for path, piece in pieces.items()
        ),
    )
