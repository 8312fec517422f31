"""The report of ten conditions: size, time, first paint: `python benchmarks/report_page.py [FOLDER]`.

The tilt-wing is flown and identified at ten conditions, its margins are computed beside the simulation's, and
`freqid report` makes one page of all. What FOLDER already holds is kept, so that a second run only makes the
page (without FOLDER, one in the temporary files: some minutes). The page is then opened five times
from its file in Debian's chromium, headless; without playwright and chromium (`make browser-test` installs
both) these columns stay empty. Writes benchmarks/report_page.csv.

megabytes           of the page
build_s, build_cpu_s  of `freqid report` as a process, imports included; wall and processor time
load                of this machine meanwhile, in processes: above its cores, wall times are too long
first_paint_ms      first contentful paint, the least of five
ready_ms            until the page's script is done, the least of five
ready_cpu_ms        processor time of the page's thread until then, which load changes less
"""

from __future__ import annotations

import csv
import os
import resource
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

AT = ("u10", "u15", "u20", "u25", "u30", "u36", "u45", "u55", "u62", "u70")
VISITS = 5
ASKED = {"megabytes": 6.0, "build_s": 25.0, "first_paint_ms": 1000.0, "ready_ms": 2000.0}
FREQID = (sys.executable, "-m", "freqid")


def made(folder: Path) -> None:
    """Fly and identify what is not there yet."""
    at = ("--at", ",".join(AT))
    if not (folder / "study.h5").is_file():
        subprocess.run([*FREQID, "study", "la8", *at, "--no-page", "-o", str(folder)], check=True)
    margins = folder / "margins.h5"
    if not margins.is_file():
        law = ("la8", "--beside", "la8", "--no-page")
        subprocess.run([*FREQID, "margins", str(folder / "model.h5"), *law, "-o", str(margins)], check=True)


def built(folder: Path, page: Path) -> dict[str, float]:
    """Return size of the page, and what it took to make it."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    start = time.perf_counter()
    command = [*FREQID, "report", str(folder), "--scenario", "la8", "-o", str(page)]
    subprocess.run(command, check=True, capture_output=True, text=True)
    wall = time.perf_counter() - start
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return {
        "megabytes": page.stat().st_size / 1e6,
        "build_s": wall,
        "build_cpu_s": after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime,
    }


def opened(page: Path) -> dict[str, float]:
    """Return when the page is painted and when it can be used; nothing without a browser."""
    chromium = shutil.which("chromium")
    try:
        from playwright.sync_api import sync_playwright
    except ImportError:
        chromium = None
    if chromium is None:
        print("no playwright or no chromium: paint is not measured", file=sys.stderr)
        return {}
    paints, ready, busy = [], [], []
    with sync_playwright() as play:
        browser = play.chromium.launch(executable_path=chromium, args=["--no-sandbox"])
        for _ in range(VISITS):
            tab = browser.new_page(viewport={"width": 1280, "height": 900})
            metrics = tab.context.new_cdp_session(tab)
            metrics.send("Performance.enable", {"timeDomain": "threadTicks"})
            tab.goto(page.resolve().as_uri())
            tab.wait_for_function("performance.getEntriesByType('paint').length > 0")
            paint = "performance.getEntriesByName('first-contentful-paint')[0].startTime"
            paints.append(tab.evaluate(paint))
            tab.wait_for_function("performance.getEntriesByName('ready').length > 0")
            ready.append(tab.evaluate("performance.getEntriesByName('ready')[0].startTime"))
            told = metrics.send("Performance.getMetrics")["metrics"]
            busy.append(1000 * next(m["value"] for m in told if m["name"] == "TaskDuration"))
            tab.close()
        browser.close()
    return {"first_paint_ms": min(paints), "ready_ms": min(ready), "ready_cpu_ms": min(busy)}


def main(folder: str = "") -> None:
    """Make the page, measure it, and write the table."""
    with tempfile.TemporaryDirectory() as temporary:
        study = Path(folder or temporary)
        made(study)
        page = Path(temporary) / "page.html"
        figures = {"conditions": float(len(AT)), **built(study, page), "load": os.getloadavg()[0]}
        figures |= opened(page)
    rows = [
        {"figure": name, "value": f"{value:.3g}", "asked": f"{ASKED[name]:g}" if name in ASKED else ""}
        for name, value in figures.items()
    ]
    for row in rows:
        print(f"{row['figure']:<16}{row['value']:>8}{row['asked'] and ', asked at most ' + row['asked']}")
    with Path(__file__).with_suffix(".csv").open("w", newline="") as file:
        writer = csv.DictWriter(file, list(rows[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)


if __name__ == "__main__":
    main(*sys.argv[1:])
