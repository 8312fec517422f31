"""What the tests of all commands share."""

from __future__ import annotations

import pandas as pd
import pytest
from scipy.interpolate import CubicSpline

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
def write_log():
    """Write a record as a text table at other times, and its column map beside it; return both paths."""

    def call(record, path, time=None):
        time = record.time if time is None else time
        table = {"t": time} | {n: CubicSpline(record.time, record[n])(time) for n in record.channels}
        pd.DataFrame(table).to_csv(path, index=False, float_format="%.12g")
        places = [
            f'[[channel]]\nname = "{n}"\ncolumn = "{n}"\nunit = "{c.unit}"\n'
            for n, c in record.channels.items()
        ]
        column_map = path.with_suffix(".toml")
        column_map.write_text('[time]\ncolumn = "t"\nunit = "s"\n' + "".join(places))
        return path, column_map

    return call
