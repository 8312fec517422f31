"""The wheel holds all that is needed outside the checkout."""

from __future__ import annotations

import os
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

PROJECT = Path(__file__).resolve().parents[2]
DATA = ("scenarios/la8.toml", "__init__.pyi", "report/templates/page.html", "report/templates/style.css")


@pytest.fixture(scope="module")
def installed(tmp_path_factory) -> Path:
    """Build a wheel and unpack it, as an installation does."""
    folder = tmp_path_factory.mktemp("wheel")
    build = f"from hatchling.build import build_wheel; print(build_wheel({str(folder)!r}))"
    done = subprocess.run(
        [sys.executable, "-c", build], cwd=PROJECT, capture_output=True, text=True, check=True
    )
    with zipfile.ZipFile(folder / done.stdout.split()[-1]) as wheel:
        wheel.extractall(folder / "site")
    return folder / "site"


def test_data_are_in_the_wheel(installed):
    assert [name for name in DATA if not (installed / "freqid" / name).is_file()] == []


def test_the_shipped_scenario_is_found_from_elsewhere(installed, tmp_path):
    code = (
        "import freqid as fq; s = fq.read_scenario('la8'); print(fq.__file__, s.reference_of('u45').u);"
        "print(fq.connect(scenario='la8'))"
    )
    environment = {**os.environ, "PYTHONPATH": str(installed)}
    done = subprocess.run(
        [sys.executable, "-c", code],
        cwd=tmp_path,
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    where, speed = done.stdout.splitlines()[0].split()
    assert where.startswith(str(installed))
    assert speed == "13.72"
    assert "scenario simulation 'la8': X Y Z L M N, flies" in done.stdout
