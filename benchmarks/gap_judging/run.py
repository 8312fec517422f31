"""Run judging cases through ``freqid diagnose-gap``, one row of a CSV file for each case.

    python benchmarks/gap_judging/run.py CASES... -o results.csv [--jobs 2] [--label NAME] [--keep FOLDER]

CASES are case folders, ``case.json`` files, or folders above them. A case that has a row is not run again
unless ``--again`` is given. Each case runs in a worker process, with the command line's own function; a
worker that exceeds ``--limit`` seconds is stopped, and the row says so. Nothing here knows how the diagnosis
works: all figures come from what ``--json`` prints.
"""

from __future__ import annotations

import argparse
import csv
import json
import math
import multiprocessing
import os
import sys
import tempfile
import time
from collections.abc import Iterable, Mapping, Sequence
from contextlib import redirect_stderr, redirect_stdout
from io import StringIO
from multiprocessing.connection import Connection, wait
from pathlib import Path
from typing import Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.setdefault("XLA_FLAGS", "--xla_cpu_multi_thread_eigen=false intra_op_parallelism_threads=1")

ROOT = Path(__file__).resolve().parents[2]
LISTED = 0.1  # share from which a row or an input counts as where the effect is
LIMIT_S = 300.0
STARTING_S = 60.0  # that a worker gets on top of its first case, for imports
QUIET = ("--no-next-flight", "--no-page", "--no-cache")  # where the command has them

COLUMNS = (
    "label",
    "case",
    "vehicle",
    "set",
    "kind",
    "stratum",
    "truth",
    "words",
    "case_aliases",
    "lambda",
    "true_rows",
    "true_inputs",
    "ideal_found",
    "ideal_G",
    "exit_code",
    "error",
    "seconds",
    "exists",
    "p",
    "named",
    "named_words",
    "named_moved",
    "p_truth",
    "set_stated",
    "pair",
    "aliases",
    "withdrawn",
    "sensors",
    "bookkeeping",
    "probabilities",
    "where_rows",
    "where_inputs",
    "closed_with",
    "G",
    "G_lo",
    "G_hi",
    "G_tolerances",
    "rmse_before",
    "rmse_after",
    "rmse_named_before",
    "rmse_named_after",
    "log_score_gain",
    "remarks",
    "form_errors",
    "json",
)
"""``words`` are names of the parameters and places of each true effect, ``named_words`` of the parameters of
each effect that the diagnosis estimates among those that it names, ``named_moved`` those of them whose
interval leaves out zero; ``rmse_*`` are relative to the rows' own rms, over the rows where the true effect
acts and over those that the diagnosis lists (all, where none of these has one); ``where_inputs`` is the share
of the listed cells that name an input, and may add up to more than one."""

Row = dict[str, Any]


def main() -> None:
    """Run the cases that have no row yet."""
    asked = _arguments()
    cases = find_cases(asked.cases)
    rows = read_rows(asked.output)
    done = set() if asked.again else {(r["label"], r["set"], r["case"]) for r in rows.values()}
    todo = [path for path in cases if _key(asked.label, read_case(path)) not in done]
    print(f"{len(cases)} cases, {len(cases) - len(todo)} of them done", flush=True)
    if asked.keep:
        asked.keep.mkdir(parents=True, exist_ok=True)
    started = time.perf_counter()
    for row in run_all(todo, asked.label, asked.jobs, asked.limit, asked.keep, asked.extra):
        rows[(row["label"], row["set"], row["case"])] = row
        write_rows(asked.output, rows.values())
        print(_line(row, time.perf_counter() - started), flush=True)


def find_cases(paths: Iterable[Path]) -> list[Path]:
    """Return the ``case.json`` files of folders and files, each once, in order.

    Raises
    ------
    SystemExit
        Where there is none.
    """
    found: dict[Path, None] = {}
    for path in paths:
        here = [path] if path.is_file() else sorted(path.rglob("case.json"))
        if not here:
            print(f"{path} holds no case.json", file=sys.stderr)
        found.update(dict.fromkeys(p.resolve() for p in here))
    if not found:
        raise SystemExit("there is no case to run")
    return list(found)


def read_case(path: Path) -> dict[str, Any]:
    """Return what a ``case.json`` says."""
    return json.loads(path.read_text(encoding="utf-8"))


def read_rows(path: Path) -> dict[tuple[str, str, str], Row]:
    """Return the rows of a results file by label, set and case; none where there is no file."""
    if not path.exists():
        return {}
    with path.open(newline="", encoding="utf-8") as file:
        return {(r["label"], r["set"], r["case"]): dict(r) for r in csv.DictReader(file)}


def write_rows(path: Path, rows: Iterable[Row]) -> None:
    """Write a results file, whole or not at all."""
    path.parent.mkdir(parents=True, exist_ok=True)
    beside = path.with_name(path.name + ".part")
    with beside.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, COLUMNS, lineterminator="\n", extrasaction="ignore", restval="")
        writer.writeheader()
        writer.writerows(rows)
    os.replace(beside, path)


def run_all(
    cases: Sequence[Path], label: str, jobs: int, limit: float, keep: Path | None, extra: Sequence[str]
) -> Iterable[Row]:
    """Run cases in worker processes and yield a row for each as it ends.

    Parameters
    ----------
    cases : sequence of Path
        ``case.json`` files.
    label : str
        Name of the code under test.
    jobs : int
        Workers.
    limit : float
        Time for one case, s.
    keep : Path, optional
        Folder that gets each diagnosis's whole JSON.
    extra : sequence of str
        Further options of the command.
    """
    said = {path: read_case(path) for path in cases}
    waiting = list(reversed(cases))
    busy: dict[Connection, tuple[Any, Path, float]] = {}
    idle = [_worker() for _ in range(min(jobs, len(cases)))]
    while waiting or busy:
        while waiting and idle:
            connection, process, fresh = idle.pop()
            path = waiting.pop()
            connection.send((path, keep, list(extra)))
            until = time.perf_counter() + limit + (STARTING_S if fresh else 0.0)
            busy[connection] = process, path, until
        soonest = min(until for _, _, until in busy.values())
        ready = wait(list(busy), timeout=max(soonest - time.perf_counter(), 0.0))
        for connection in [c for c in busy if c in ready]:
            process, path, _ = busy.pop(connection)
            try:
                row = connection.recv()
                idle.append((connection, process, False))
            except EOFError:
                process.join()
                row = row_of(said[path], None, "", f"the worker ended with code {process.exitcode}", math.nan)
                idle.append(_worker())
            yield {**row, "label": label}
        for connection in [c for c in busy if busy[c][2] < time.perf_counter()]:
            process, path, _ = busy.pop(connection)
            process.kill()
            process.join()
            idle.append(_worker())
            row = row_of(said[path], None, "", f"over the time limit of {limit:g} s", limit)
            yield {**row, "label": label}
    for connection, process, _ in idle:
        connection.send(None)
        process.join()


def run_case(path: Path, keep: Path | None = None, extra: Sequence[str] = ()) -> Row:
    """Diagnose one case and return its row, without a label.

    Parameters
    ----------
    path : Path
        ``case.json``.
    keep : Path, optional
        Folder that gets the whole JSON.
    extra : sequence of str
        Further options of the command.
    """
    from freqid.cli.main import run

    case, out, told = read_case(path), StringIO(), StringIO()
    with tempfile.TemporaryDirectory() as folder:
        arguments = [*_command_of(case, path.parent), "-o", str(Path(folder) / "gap.h5"), *extra]
        before = time.perf_counter()
        code: Any = 0
        try:
            with redirect_stdout(out), redirect_stderr(told):
                run(arguments)
        except SystemExit as end:
            code = end.code or 0
        seconds = time.perf_counter() - before
    said = told.getvalue().replace(f"{path.parent}/", "").replace(f"{ROOT}/", "").replace(folder, "")
    row = row_of(case, code, out.getvalue(), said, seconds)
    if keep and out.getvalue().strip():
        name = f"{case['set']}-{case['case']}.json".replace("/", "-")
        (keep / name).write_text(out.getvalue(), encoding="utf-8")
        row["json"] = name
    return row


def row_of(case: Mapping[str, Any], code: int | None, out: str, told: str, seconds: float) -> Row:
    """Return a case's row from what the command printed.

    Parameters
    ----------
    case : dict
        Of ``case.json``.
    code : int or None
        Exit code; None where the command did not end by itself.
    out, told : str
        What went to stdout and stderr.
    seconds : float
    """
    effects = case.get("effects") or {}
    place = case.get("place")
    places = place if isinstance(place, Mapping) else dict.fromkeys(effects, place)
    where, ideal = case.get("where") or {}, case.get("ideal") or {}
    row: Row = dict.fromkeys(COLUMNS, "") | {
        "case": case["case"],
        "vehicle": case.get("vehicle", ""),
        "set": case["set"],
        "kind": case["kind"],
        "stratum": case.get("stratum") or "",
        "truth": " ".join(effects),
        "words": _dumped({i: [*(s or {}), *_words(places.get(i))] for i, s in effects.items()}),
        "case_aliases": _dumped(case.get("aliases") or []),
        "lambda": _dumped(_rounded(case.get("lambda") or {})),
        "true_rows": _dumped(_rounded(where.get("rows") or {})),
        "true_inputs": _dumped(_rounded(where.get("inputs") or {})),
        "ideal_found": "" if ideal.get("found") is None else int(ideal["found"]),
        "ideal_G": _number(ideal.get("G")),
        "exit_code": "" if code is None else code,
        "error": _sentence(told) if code != 0 else "",
        "seconds": f"{seconds:.1f}" if seconds == seconds else "",
    }
    try:
        found = json.loads(out)
    except ValueError:
        return row
    row["bookkeeping"] = _dumped(
        [b.get("fault") or b.get("id") or b.get("sentence") for b in found.get("bookkeeping") or []]
    )
    return row | _answers(found, list(effects), case["kind"], where.get("rows") or {})


def _answers(
    found: Mapping[str, Any], truth: Sequence[str], kind: str, acts: Mapping[str, float]
) -> dict[str, Any]:
    """Return the columns that a diagnosis fills."""
    gap, which = found.get("gap") or {}, found.get("which") or {}
    far = found.get("how_far") or {}
    wrench, changes = far.get("wrench") or {}, (far.get("rmse") or {}).get("by_response") or {}
    chances = which.get("probabilities") or {}
    right = truth or [{"null": "none"}.get(kind, "other")]
    rows, inputs = _where(found.get("where") or [])
    true_rows = [n for n, s in acts.items() if s >= LISTED]
    true_before, true_after = _relative(changes, true_rows)
    named_before, named_after = _relative(changes, [n for n, s in rows.items() if s >= LISTED])
    if named_before is None:  # it lists none of the rows that have an RMSE
        named_before, named_after = _relative(changes, changes)
    alone = far.get("tolerances_only") or {}
    sizes = which.get("parameters") or {}
    given = dict.fromkeys([*(which.get("named") or ()), *(which.get("pair") or ())])
    return {
        "exists": "" if gap.get("exists") is None else int(gap["exists"]),
        "p": _number(gap.get("p")),
        "named": " ".join(which.get("named") or ()),
        "named_words": _dumped({i: list(which["parameters"].get(i) or {}) for i in given})
        if which.get("parameters")
        else "",
        "named_moved": _dumped({i: _moved(sizes[i]) for i in given if i in sizes}),
        "p_truth": _number(sum(chances.get(i, 0.0) for i in right)) if chances else "",
        "set_stated": " ".join(which.get("set") or ()),
        "pair": " ".join(which.get("pair") or ()),
        "aliases": _dumped(which.get("aliases") or []),
        "withdrawn": _dumped(which.get("withdrawn") or {}),
        "sensors": _dumped([f"{s.get('fault')} {s.get('channel')}" for s in found.get("sensors") or []]),
        "probabilities": _dumped({n: round(p, 4) for n, p in chances.items() if p >= 0.0005}),
        "where_rows": _dumped(_rounded(rows)),
        "where_inputs": _dumped(_rounded(inputs)),
        "closed_with": "+".join(far.get("effects") or ()),
        "G": _number(wrench.get("G")),
        "G_lo": _number(wrench.get("lo")),
        "G_hi": _number(wrench.get("hi")),
        "G_tolerances": _number((alone.get("wrench") or alone).get("G")),
        "rmse_before": _number(true_before),
        "rmse_after": _number(true_after),
        "rmse_named_before": _number(named_before),
        "rmse_named_after": _number(named_after),
        "log_score_gain": _number(log_score_gain(far)),
        "remarks": len(found.get("remarks") or ()),
        "form_errors": _dumped(
            _rounded({n: f for n, f in (gap.get("form_errors") or {}).items() if f is not None})
        ),
    }


def _moved(sizes: Mapping[str, Mapping[str, Any]]) -> list[str]:
    """Return the parameters of which an estimate says that they are off."""
    return [n for n, x in sizes.items() if x["lo"] > 0 or x["hi"] < 0]


def log_score_gain(far: Mapping[str, Any]) -> float | None:
    """Return by how much the held-out log score with the effect is above that of tolerances alone.

    Parameters
    ----------
    far : dict
        ``how_far`` of a diagnosis: a key with ``log_score`` in it holds the gain, or both scores.
    """
    for key, value in far.items():
        if "log_score" not in key:
            continue
        if not isinstance(value, Mapping):
            return value
        if value.get("gain") is not None:
            return value["gain"]
        for less, more in (("tolerances_only", "both"), ("tolerances", "both"), ("before", "after")):
            if value.get(less) is not None and value.get(more) is not None:
                return value[more] - value[less]
    return None


def row_name(name: str) -> str:
    """Return a row's name as cases and diagnoses share it: ``M``, ``actuator/elevator``, ``kinematic/w``."""
    group, _, last = name.rpartition("/")
    return last if group in ("load", "loads", "wrench", "response") else name


def _where(cells: Sequence[Mapping[str, Any]]) -> tuple[dict[str, float], dict[str, float]]:
    """Return the shares of the listed cells by row, and by each input that they name."""
    rows: dict[str, float] = {}
    inputs: dict[str, float] = {}
    for cell in cells:
        share = cell.get("share") or 0.0
        rows[row_name(cell["response"])] = rows.get(row_name(cell["response"]), 0.0) + share
        for name in _words(cell.get("input")):
            inputs[name] = inputs.get(name, 0.0) + share
    return rows, inputs


def _relative(
    changes: Mapping[str, Mapping[str, Any]], rows: Iterable[str]
) -> tuple[float | None, float | None]:
    """Return RMSE before and after over rows, each relative to the row's own rms; None without any."""
    found = {row_name(n): c for n, c in changes.items()}
    kept = [found[row_name(n)] for n in rows if row_name(n) in found]
    kept = [c for c in kept if c.get("before") is not None and c.get("after") is not None]
    if not kept:
        return None, None
    over = [c.get("zero") or c["before"] or 1.0 for c in kept]
    before, after = (
        math.sqrt(sum((c[end] / o) ** 2 for c, o in zip(kept, over, strict=True)) / len(kept))
        for end in ("before", "after")
    )
    return before, after


def _command_of(case: Mapping[str, Any], folder: Path) -> list[str]:
    """Return the arguments of a case, without where the result goes."""
    from freqid.cli.diagnose_gap import command

    known = {o for p in command.params for o in (*p.opts, *p.secondary_opts)}
    file, _, name = case["simulation"].rpartition(":")
    found = ["diagnose-gap", *(str(_path(p, folder)) for p in case["use"])]
    for path in case.get("holdout") or ():
        found += ["--holdout", str(_path(path, folder))]
    # a function in a file; else words of the command itself, such as jsbsim:c172p, or a scenario
    found += ["--sim", f"{_path(file, folder)}:{name}" if file.endswith(".py") else case["simulation"]]
    if case.get("scenario"):
        found += ["--scenario", str(_path(case["scenario"], folder))]
    if case.get("band_hz"):
        found += ["--band", ":".join(f"{x:g}" for x in case["band_hz"])]
    return [*found, "--json", *(o for o in QUIET if o in known)]


def _path(text: str, folder: Path) -> Path:
    """Return a path of a case: beside it, else from the repository's root."""
    return folder / text if (folder / text).exists() else ROOT / text


def _worker() -> tuple[Connection, Any, bool]:
    context = multiprocessing.get_context("spawn")
    here, there = context.Pipe()
    process = context.Process(target=_serve, args=(there,), daemon=True)
    process.start()
    there.close()
    return here, process, True


def _serve(connection: Connection) -> None:
    """Run cases as they come, until there is none."""
    import freqid

    print(f"freqid {freqid.__version__} from {Path(freqid.__file__).parent}", flush=True)
    while asked := connection.recv():
        connection.send(run_case(*asked))


def _key(label: str, case: Mapping[str, Any]) -> tuple[str, str, str]:
    return label, case["set"], case["case"]


def _words(value: Any) -> list[str]:
    """Return names from one string, separated by commas, spaces or plus signs, or from a list of them."""
    if isinstance(value, Mapping):
        return [str(v) for v in value.values()]
    if isinstance(value, str):
        return value.replace(",", " ").replace("+", " ").split()
    return [str(v) for v in value or ()]


def _rounded(table: Mapping[str, float]) -> dict[str, float]:
    return {n: float(f"{x:.4g}") for n, x in table.items()}


def _dumped(value: Any) -> str:
    return json.dumps(value, separators=(",", ":")) if value else ""


def _number(value: Any) -> str:
    return f"{value:.4g}" if isinstance(value, int | float) and math.isfinite(value) else ""


def _sentence(told: str) -> str:
    """Return the error sentence of the command, else the last line that it printed."""
    lines = [line.strip() for line in told.replace("\r", "\n").splitlines() if line.strip()]
    own = [line for line in lines if line.startswith(("freqid:", "Error:"))]
    if any(line.endswith("please report it with the command.") for line in lines):
        own = lines[-2:-1]  # a bug: the line of the exception
    return " ".join((own or lines)[-1:])[:400]


def _line(row: Row, passed: float) -> str:
    told = row["pair"] or row["named"] or ("gap" if row["exists"] in (1, "1") else "-")
    return (
        f"{passed:7.0f} s  {row['set']} {row['case']}: {row['kind']} {row['stratum']} {row['truth'] or '-'}"
        f" -> exit {row['exit_code']}, p {row['p']}, {told}, {row['seconds']} s {row['error']}"
    )


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("cases", nargs="+", type=Path, help="case folders, or folders above them")
    parser.add_argument("-o", "--output", type=Path, required=True, help="results, a CSV file")
    parser.add_argument("--jobs", type=int, default=1, help="cases at a time")
    parser.add_argument("--label", default="", help="name of the code under test, a column of the results")
    parser.add_argument("--limit", type=float, default=LIMIT_S, help="time for one case, s")
    parser.add_argument("--keep", type=Path, help="folder that gets each diagnosis's whole JSON")
    parser.add_argument("--again", action="store_true", help="run cases that have a row once more")
    parser.add_argument("--extra", nargs="*", default=[], help="further options of the command")
    return parser.parse_args()


if __name__ == "__main__":
    sys.exit(main())
