"""``python -m freqid`` is the same as ``freqid``."""

from freqid.cli.main import run

run()
