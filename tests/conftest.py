"""Fixtures that every kind of test may use."""

from __future__ import annotations

import importlib.util
import shutil
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import pytest
from hypothesis import settings

from freqid.cli.main import run

# The same examples on every machine, and no verdict on how fast a shared one runs them.
settings.register_profile("project", derandomize=True, deadline=None)
settings.load_profile("project")

PROJECT = Path(__file__).resolve().parents[1]
SHARED_DATA = PROJECT.parent / "shared" / "data"


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """Real flight data beside the project; their licences keep them out of the repository."""
    if not SHARED_DATA.is_dir():
        pytest.skip("the real flight data are not beside this checkout (../shared/data)")
    return SHARED_DATA


@pytest.fixture(scope="session")
def script() -> Callable[[str], ModuleType]:
    """Load a script that no package holds, by its path inside the project."""

    def load(path: str) -> ModuleType:
        spec = importlib.util.spec_from_file_location(f"script_{Path(path).stem}", PROJECT / path)
        assert spec is not None
        assert spec.loader is not None
        module = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(module)
        return module

    return load


@pytest.fixture(scope="session")
def linear_aircraft(script):
    """The module that flies an aircraft of known derivatives."""
    return script("examples/linear_record.py")


@pytest.fixture(scope="session")
def linear_logs(linear_aircraft, tmp_path_factory):
    """Two logs of the linear aircraft in field units: one without noise, one with all of it."""
    folder = tmp_path_factory.mktemp("linear")
    logs = {"clean": folder / "clean.csv", "noisy": folder / "noisy.csv"}
    for seed, (name, path) in enumerate(logs.items()):
        linear_aircraft.fly(seed=seed, noise=float(name == "noisy"), periods=1).to_csv(path, index=False)
    return logs


@pytest.fixture(scope="session")
def fly_worn(linear_aircraft, script):
    """Put flights of `examples/gap_flights.py` with some loss, and the sound simulation, into a folder."""
    project = linear_aircraft.__file__.rpartition("/examples/")[0]
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(f"{project}/examples")
        example = script("examples/gap_flights.py")

    def fly(folder, loss, seeds, period=30.0):
        worn = example.derivatives(loss)
        shutil.copy(f"{project}/examples/linear_simulation.py", folder)
        for seed in seeds:
            log = folder / f"flight{seed}.csv"
            table = linear_aircraft.fly(seed=seed, period=period, periods=1, derivatives=worn)
            table.to_csv(log, index=False, float_format="%.10g")
            words = f"import-log {log} --scenario {project}/scenarios/linear.toml --at u20 "
            words += f"--map {project}/scenarios/maps/linear.toml -o {folder}/flight{seed}.h5"
            with pytest.raises(SystemExit) as left:
                run(words.split())
            assert left.value.code == 0

    return fly
