"""The command line: parse, call the library, render.

Heavy imports happen inside the commands, so that help is quick. A new command is a module beside this one and a line in
`COMMANDS`.
"""

from __future__ import annotations

import gc
import os
import sys
import warnings
from collections.abc import Callable
from importlib import import_module
from types import MappingProxyType
from typing import Annotated, Any, cast

import typer
from typer.core import TyperGroup

from foresee_dsl import __version__
from foresee_dsl.cli.completion import VARIABLE
from foresee_dsl.cli.options.common import BUG, Consenting, explain_error
from foresee_dsl.cli.options.output import for_tools
from foresee_dsl.cli.options.plain_output import guard_streams

COMMANDS = (
    ("Write", "init", "writing.init.init"),
    ("Write", "check", "writing.check.check"),
    ("Write", "explain", "writing.check.explain"),
    ("Write", "fmt", "writing.formatting.fmt"),
    ("Write", "draw", "writing.draw.draw"),
    ("Write", "sample", "writing.author.sample"),
    ("Write", "compile", "writing.author.compile_"),
    ("Write", "expand", "writing.author.expand"),
    ("Write", "diff", "writing.compare.diff"),
    ("Write", "textconv", "writing.compare.textconv"),
    ("Write", "git-diff", "writing.compare.git_diff"),
    ("Run and derive", "run", "runs.run"),
    ("Run and derive", "show", "show.show"),
    ("Run and derive", "forecast", "runs.forecast"),
    ("Run and derive", "clip", "runs.clip"),
    ("Run and derive", "mutate", "runs.mutate"),
    ("Run and derive", "repin", "writing.compare.repin"),
    ("Run and derive", "minimise", "minimise.minimise"),
    ("Campaign", "assess", "campaigns.assess"),
    ("Campaign", "campaign", "campaigns.campaign"),
    ("Campaign", "plan", "campaigns.plan"),
    ("Campaign", "study", "study.study"),
    ("Campaign", "fuzz", "fuzz.fuzz"),
    ("Campaign", "review", "minimise.review"),
    ("Campaign", "store", "store.store"),
    ("Campaign", "keep", "keep.keep"),
    ("Campaign", "verify", "keep.verify"),
    ("Campaign", "compare", "keep.compare"),
    ("Report", "report", "report.report"),
    ("Report", "view", "report.view"),
    ("Exchange", "import", "formats.import_"),
    ("Exchange", "export", "formats.export"),
    ("About", "drivers", "about.drivers"),
    ("About", "models", "about.models"),
    ("About", "lsp", "about.lsp"),
    ("About", "completion", "completion.completion"),
    ("About", "doctor", "about.doctor"),
)
"""Every command in the order of the help: its group there, its name, and its function as `MODULE.FUNCTION` of this
package. A command's module is imported when it is named, so a new one costs the others nothing."""


class _Commands(TyperGroup):
    """The commands of `COMMANDS`, each made when it is asked for."""

    def __init__(self, **settings: Any) -> None:  # noqa: ANN401 - typer's own, passed on
        super().__init__(**settings)
        self.commands = dict.fromkeys(self._table, cast("Any", None))  # the names, for "did you mean"

    _table = MappingProxyType({name: (panel, function) for panel, name, function in COMMANDS})

    def get_command(self, ctx: object, cmd_name: str) -> Any:  # noqa: ANN401 - a type that typer keeps to itself
        """Return a command, or None for a name that is none."""
        del ctx
        if cmd_name not in self._table:
            return None
        panel, function = self._table[cmd_name]
        module, _, attribute = f"foresee_dsl.cli.{function}".rpartition(".")
        if self.commands[cmd_name] is None:
            call = getattr(import_module(module), attribute)
            grouped = isinstance(call, typer.Typer)
            self.commands[cmd_name] = _group(call, panel) if grouped else _alone(call, cmd_name, panel)
        return self.commands[cmd_name]


_SETTINGS = {"help_option_names": ["-h", "--help"]}


def _alone(call: Callable[..., None], name: str, panel: str) -> Any:  # noqa: ANN401 - as above
    alone = typer.Typer(add_completion=False, rich_markup_mode="rich", context_settings=_SETTINGS)
    alone.command(name=name, cls=Consenting, rich_help_panel=panel)(for_tools(call, name))
    return typer.main.get_command(alone)


def _group(group: typer.Typer, panel: str) -> Any:  # noqa: ANN401 - as above
    """A command with commands of its own, such as `import`; its module gives them to a `typer.Typer`."""
    made = typer.main.get_group(group)
    made.rich_help_panel = panel
    return made


app = typer.Typer(
    name="foresee",
    cls=_Commands,
    help="Write traffic situations as text, drive your software through them, "
    "and find the failures behind the near misses.",
    epilog="A test case is addressed like a pytest node: [cyan]scenarios/scenario7.foresee::r03[/cyan]. "
    "Exit codes: 0 nothing failed, 1 failures were found or the input has errors, 2 wrong usage, 3 our own fault.",
    no_args_is_help=True,
    rich_markup_mode="rich",
    pretty_exceptions_enable=False,
    add_completion=VARIABLE in os.environ,
    context_settings=_SETTINGS,
)


def _version(value: bool) -> None:
    if value:
        typer.echo(f"foresee {__version__}")
        raise typer.Exit


@app.callback()
def _root(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version.")
    ] = False,
    limit: Annotated[
        list[str] | None,
        typer.Option(
            "--limit",
            metavar="NAME=NUMBER",
            help="Raise a limit on what one input may take: the name is in the message that refuses it.",
        ),
    ] = None,
) -> None:
    """Hold the options that stand before a command; `--version` prints and leaves in its callback."""
    del version
    if limit:
        from foresee_dsl.limits import allow

        allow(limit)


def main() -> None:
    """Run the command line; the exit code says how it went, and no user's mistake ends in a traceback."""
    # Most of a short command is importing, which makes many objects and no garbage: a tenth of its time is saved.
    gc.set_threshold(100_000)
    # Pydantic 2.14 would look through all that is installed for plug-ins of its own: a fiftieth of a check's work. Who
    # has one sets the variable to nothing.
    os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")
    guard_streams()
    warnings.formatwarning = lambda message, *_, **__: f"warning: {message}\n"
    try:
        try:
            app()
        finally:
            sys.stdout.flush()  # that its reader has gone is noticed here, and not when the interpreter ends
    except KeyboardInterrupt:
        sys.exit(130)
    except Exception as error:
        code = explain_error(error)
        if code == BUG and os.environ.get("FORESEE_DEBUG"):
            raise
        sys.exit(code)
    finally:
        # The process ends: looking through all that was imported for cycles would be a seventh of a check's time.
        gc.freeze()
