"""The Python examples in README and docs run as they stand."""

import re
import shutil
from pathlib import Path

import pytest

import freqid as fq
from freqid.cli.main import COMMANDS

PROJECT = Path(__file__).resolve().parents[2]
PAGES = [PROJECT / "README.md", *sorted((PROJECT / "docs").rglob("*.md"))]
EXAMPLES = {p: re.findall(r"^```python\n(.*?)^```", p.read_text(), re.M | re.S) for p in PAGES}


@pytest.mark.parametrize("page", [p for p in PAGES if EXAMPLES[p]], ids=lambda p: p.name)
def test_examples_run(page, linear_logs, tmp_path, monkeypatch, capsys):
    shutil.copy(linear_logs["noisy"], tmp_path / "flight.csv")
    shutil.copy(PROJECT / "scenarios" / "linear.toml", tmp_path / "scenario.toml")
    shutil.copy(PROJECT / "scenarios" / "maps" / "linear.toml", tmp_path / "columns.toml")
    monkeypatch.chdir(tmp_path)
    names = {}
    for example in EXAMPLES[page]:
        exec(compile(example, str(page), "exec"), names)
    if page.name == "README.md":
        assert "M_de = -4" in capsys.readouterr().out


def test_the_front_page_leads_to_every_page_and_command():
    front = (PROJECT / "docs" / "index.md").read_text()
    pages = {p.relative_to(PROJECT / "docs").as_posix() for p in PAGES[1:]} - {"index.md"}
    assert pages - set(re.findall(r"\]\(([^)#:]+)\)", front)) == set()
    assert pages - set(re.findall(r": (\S+\.md)$", (PROJECT / "mkdocs.yml").read_text(), re.M)) == set()
    assert [c for c in COMMANDS if f"freqid {c}" not in front and c != "report"] == []
    table = (PROJECT / "docs" / "commands.md").read_text()
    assert [c for c in COMMANDS if f"| `{c}` |" not in table] == []


def test_the_reference_lists_every_public_name():
    reference = (PROJECT / "docs" / "reference.md").read_text()
    listed = {line.rpartition(".")[2] for line in reference.splitlines() if line.startswith("::: ")}
    assert set(fq.__all__) - listed == set()


def test_links_lead_somewhere():
    for page in PAGES:
        for target in re.findall(r"\]\(([^)#:]+)(?:#[^)]*)?\)", page.read_text()):
            assert (page.parent / target).exists(), f"{page.name} links to {target}"
