"""What the tests of all commands share."""

from __future__ import annotations

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
