"""The command line: parse, call the library, render.

Heavy imports happen inside the commands, so that help is quick.
"""

from __future__ import annotations

import gc
import os
import sys
from typing import Annotated

import typer

from foresee_dsl import __version__
from foresee_dsl.cli import author, campaigns, doctor, runs
from foresee_dsl.cli.common import BUG, explain_error

app = typer.Typer(
    name="foresee",
    help="Write traffic situations as text, drive your software through them, "
    "and find the failures behind the near misses.",
    epilog="A test case is addressed like a pytest node: [cyan]scenarios/scenario7.foresee::r03[/cyan]. "
    "Exit codes: 0 done, 1 the input has errors or the check failed, 2 wrong usage, 3 our own fault.",
    no_args_is_help=True,
    rich_markup_mode="rich",
    pretty_exceptions_enable=False,
    add_completion=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)

_AUTHOR, _RUN, _CAMPAIGN, _ABOUT = "Write", "Run and derive", "Campaign", "About"
for group, commands in (
    (_AUTHOR, (author.check, author.fmt, author.compile_, author.expand, author.diff)),
    (_RUN, (runs.run, runs.forecast, runs.clip, runs.mutate)),
    (_CAMPAIGN, (campaigns.campaign, campaigns.verify)),
    (_ABOUT, (author.drivers, author.models, doctor.doctor)),
):
    for command in commands:
        app.command(name=command.__name__.rstrip("_"), rich_help_panel=group)(command)


def _version(value: bool) -> None:
    if value:
        typer.echo(f"foresee {__version__}")
        raise typer.Exit


@app.callback()
def _root(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    """Hold the options that stand before a command; `--version` prints and leaves in its callback."""
    del version


def main() -> None:
    """Run the command line; the exit code says how it went, and no user's mistake ends in a traceback."""
    # Most of a short command is importing, which makes many objects and no garbage: a tenth of its time is saved.
    gc.set_threshold(100_000)
    try:
        app()
    except KeyboardInterrupt:
        sys.exit(130)
    except BrokenPipeError:
        # The reader (`| head`) is gone; nothing more can be said, not even at shutdown.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        sys.exit(1)
    except Exception as error:
        code = explain_error(error)
        if code == BUG and os.environ.get("FORESEE_DEBUG"):
            raise
        sys.exit(code)
