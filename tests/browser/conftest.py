"""Pages of a real study in Debian's chromium, headless: `make browser-test` says which study."""

from __future__ import annotations

import csv
import os
import shutil
from pathlib import Path

import pytest

from freqid.views.page import page as page_of

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
STUDY = os.environ.get("FREQID_STUDY", "")
DESK, PHONE = 1280, 390


@pytest.fixture(scope="session")
def pages(tmp_path_factory) -> dict[str, Path]:
    """The report about the study, and the pages of one of its points and of its global model."""
    if not STUDY:
        pytest.skip("no study is named: `make browser-test` flies one and sets FREQID_STUDY")
    study = Path(STUDY)
    folder = tmp_path_factory.mktemp("pages")
    made = {"report": study / "index.html"}
    for name, result in (
        ("point", sorted((study / "points").glob("*.h5"))[-1]),
        ("global", study / "model.h5"),
    ):
        made[name] = folder / f"{name}.html"
        page_of(result).save(made[name])
    return made


@pytest.fixture(scope="session")
def browser():
    playwright = pytest.importorskip(
        "playwright.sync_api", reason="playwright is not installed: `make browser-test`"
    )
    if CHROMIUM is None:
        pytest.skip("chromium is not installed: `make browser-test` does that on Debian")
    with playwright.sync_playwright() as play:
        launched = play.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        yield launched
        launched.close()


class Visit:
    """A page that is open, and what it has asked for and complained about."""

    def __init__(self, browser, file: Path, width: int, colours: str = "light", at: str = "") -> None:
        self.context = browser.new_context(
            viewport={"width": width, "height": 900}, color_scheme=colours, accept_downloads=True
        )
        self.page = self.context.new_page()
        self.complaints: list[str] = []
        self.requests: list[str] = []
        self.page.on(
            "console", lambda m: self.complaints.append(m.text) if m.type in ("error", "warning") else None
        )
        self.page.on("pageerror", lambda error: self.complaints.append(str(error)))
        self.page.on("request", lambda request: self.requests.append(request.url))
        self.address = file.resolve().as_uri()
        self.page.goto(self.address + at)

    def open_all(self) -> None:
        self.page.evaluate("document.querySelectorAll('details').forEach(part => { part.open = true; })")

    @property
    def conditions(self) -> str:
        """The id of the table of the study's conditions."""
        return self.page.locator("table[id$='conditions.1']").first.get_attribute("id") or ""

    def csv(self, table: str) -> list[list[str]]:
        """Return what the button of a table copies."""
        self.page.evaluate("navigator.clipboard.writeText = async text => { window.copied = text; }")
        self.page.locator(f"[id='{table}'] + .csv").click()
        return list(csv.reader(self.page.evaluate("window.copied").strip().split("\n")))


@pytest.fixture
def visit(browser, pages):
    """Open a page by name: `visit("report", DESK)`."""
    opened: list[Visit] = []

    def go(name: str, width: int = DESK, colours: str = "light", at: str = "") -> Visit:
        opened.append(Visit(browser, pages[name], width, colours, at))
        return opened[-1]

    yield go
    for one in opened:
        one.context.close()
