"""``freqid import-log``: a log of another tool becomes a flight record."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from freqid.cli import options
from freqid.cli.options import FILE

_OF_READING = (
    "destination",
    "columns",
    "at",
    "resample_hz",
    "despike",
    "design",
    "cut",
    "split",
    "plausibility",
)


@click.command("import-log")
@click.argument("log", type=FILE)
@options.output("the log's name with .h5, in reports/")
@click.option("--map", "columns", type=FILE, help="TOML map of columns to channels, or name of a ready one.")
@click.option("--list", "list_", is_flag=True, help="Show the channels and propose a map, as TOML on stdout.")
@click.option("--scenario", type=FILE, help="Scenario that describes the vehicle.")
@click.option("--at", default="", help="Id of the reference condition that was flown.")
@click.option("--resample", "resample_hz", type=float, help="Put all channels on this rate, Hz.")
@click.option("--despike", is_flag=True, help="Leave single outlying samples out and count them.")
@click.option("--align", "design", type=FILE, help="Design that was flown and not logged: find and add it.")
@click.option(
    "--cut",
    callback=options.parsed(options.span),
    help="Keep START:STOP, seconds on the log's clock, for example 12.5:72.5.",
)
@click.option("--split", is_flag=True, help="Find the manoeuvres and write each to NAME-1.h5, NAME-2.h5, ...")
@click.option(
    "--plausibility",
    type=click.Choice(["refuse", "report", "off"]),
    default="refuse",
    show_default=True,
    help="Units, signs, columns, limits, frozen channels: refuse a log with errors, report, or look away.",
)
@options.as_json
def command(
    log: Path,
    destination: Path | None,
    columns: Path | None,
    list_: bool,
    scenario: Path | None,
    design: Path | None,
    split: bool,
    json_: bool,
    **asked: Any,
) -> None:
    """Read LOG (CSV, Parquet, MATLAB, SIDPAC columns, ULog, DataFlash) and write a flight record.

    Units are converted to SI, time is checked to be uniform, channels are checked against each other, and
    nothing is resampled unless asked.
    """
    from freqid.cli.record_texts import (
        dropouts_text,
        earlier_pieces,
        listing_result,
        plausibility_sentences,
        records_result,
        records_text,
    )
    from freqid.workflows.files import save
    from freqid.workflows.import_log import align_excitation, list_log, read_log, read_pieces, split_flight
    from freqid.workflows.inputs import scenario_of

    if list_:
        options.refuse_beside("--list", *_OF_READING)
        listing = list_log(log, scenario=scenario)
        options.emit(json_, listing_result(listing), str(listing).rstrip())
        return
    described = scenario_of(scenario) if scenario else None
    read = read_pieces if split else read_log
    found = read(log, columns, scenario=described, **asked)
    flights = found if isinstance(found, list) else [found]
    if design is not None:
        flights = [align_excitation(flight, design) for flight in flights]
    destination = destination or Path("reports") / f"{log.stem}.h5"
    pieces = {destination: flights[0]}
    if split:
        name = f"{destination.stem}-{{}}{destination.suffix}"
        every = split_flight(flights, name=str(log))
        pieces = {destination.with_name(name.format(i)): piece for i, piece in enumerate(every, start=1)}
    for path in pieces:
        options.keep_inputs(path, log, columns, scenario, design)
    for sentence in dict.fromkeys(s for flight in flights for s in plausibility_sentences(flight)):
        click.echo(sentence, err=True)
    for path, piece in pieces.items():
        save(piece, path, scenario=described)
    told = dropouts_text(flights[0], split=split), *(earlier_pieces(destination, pieces) if split else ())
    for sentence in filter(None, told):
        click.echo(sentence, err=True)
    options.emit(json_, records_result(pieces), records_text(pieces))
