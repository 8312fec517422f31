"""What the tests of all commands share."""

from __future__ import annotations

import shutil

import pytest

from freqid.cli.main import run


@pytest.fixture
def freqid(capsys):
    """Run one command in this process; return exit code, stdout and stderr."""

    def call(*arguments):
        with pytest.raises(SystemExit) as left:
            run([str(a) for a in arguments])
        captured = capsys.readouterr()
        return left.value.code, captured.out, captured.err

    return call


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
