"""The command line: one group, commands loaded when they are asked for, and the exit codes."""

from __future__ import annotations

import importlib
import os
import sys
import traceback
import warnings
from typing import TextIO

import click

from freqid import __version__
from freqid.core.errors import EXIT_BUG, EXIT_DATA, FreqidError, UncheckedFile

# Products here are small, and threads cost them more than they gain; a user's own setting stands.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

COMMANDS = {
    "new-scenario": "new_scenario",
    "check": "check",
    "design-inputs": "design_inputs",
    "simulate": "simulate",
    "import-log": "import_log",
    "quicklook": "quicklook",
    "identify-point": "identify_point",
    "frequency-response": "frequency_response",
    "global-blend": "global_blend",
    "export": "export",
    "predict": "predict",
    "score": "score",
    "margins": "margins",
    "check-simulation": "check_simulation",
    "diagnose-gap": "diagnose_gap",
    "fly-sealed": "fly_sealed",
    "open-seal": "open_seal",
    "report": "report",
    "study": "study",
    "campaign": "campaign",
}


class LazyGroup(click.Group):
    """A group whose commands live in modules of their own, in the order that work flows."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Return the command names in the order of `COMMANDS`."""
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Import one command's module and return its ``command``."""
        if cmd_name not in COMMANDS:
            return None
        return importlib.import_module(f"freqid.cli.{COMMANDS[cmd_name]}").command


@click.group(cls=LazyGroup, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(__version__, prog_name="freqid")
def main() -> None:
    """Frequency-domain system identification of eVTOL aircraft from flight data.

    A campaign goes design-inputs, simulate or import-log, identify-point, global-blend, report. Results go
    to stdout, progress and errors to stderr. Exit codes: 0 good, 2 usage, 3 unreadable or inconsistent
    data, 4 finished but a gate of the scenario failed, 70 a bug.
    """


def run(arguments: list[str] | None = None) -> None:
    """Run the command line and leave with the exit code of what happened."""
    sys.exit(_exit_code(arguments))


def _exit_code(arguments: list[str] | None) -> int:
    try:
        with warnings.catch_warnings():
            warnings.showwarning = _said
            outcome = main.main(arguments, prog_name="freqid", standalone_mode=False)
        return outcome if isinstance(outcome, int) else 0
    except click.ClickException as error:
        error.show()
        return error.exit_code
    except click.Abort:
        click.echo("freqid: stopped; nothing was written.", err=True)
        return 130
    except FreqidError as error:
        click.echo(f"freqid: {error}", err=True)
        return error.exit_code
    except OSError as error:  # of the system: a folder that is read-only, a disk that is full
        click.echo(f"freqid: {error.filename or 'a file'}: {error.strerror or error}.", err=True)
        return EXIT_DATA
    except MemoryError:
        click.echo(
            "freqid: there is not enough memory for this; use a shorter record or fewer lines.", err=True
        )
        return EXIT_DATA
    except Exception:
        traceback.print_exc()
        click.echo(f"freqid {__version__}: the above is a bug; please report it with the command.", err=True)
        return EXIT_BUG


def _said(
    message: Warning | str,
    category: type[Warning],
    filename: str,
    lineno: int,
    file: TextIO | None = None,
    line: str | None = None,
) -> None:
    """Print a warning of ours as one sentence; its place in the code is for those who work on freqid."""
    if issubclass(category, UncheckedFile):
        click.echo(f"freqid: {message}.", err=True)
    else:
        click.echo(warnings.formatwarning(message, category, filename, lineno), err=True, nl=False)


if __name__ == "__main__":
    run()
