"""The command line `foresee`: each command parses its options, calls the library and prints the result.

Heavy imports happen inside the commands, so that help is quick. To add a command, write a module beside this one and a
line in `COMMANDS`; other packages add commands by entry points (`foresee_dsl.cli.added`).
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
from typer.core import TyperCommand, TyperGroup

from foresee_dsl import __version__
from foresee_dsl.cli.completion import VARIABLE
from foresee_dsl.cli.options.common import BUG, SETTINGS, ForeseeCommand, explain_error
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
    ("Run and derive", "minimise", "findings.minimise"),
    ("Campaign", "conform", "drivers.conform"),
    ("Campaign", "assess", "drivers.assess"),
    ("Campaign", "campaign", "campaigns.campaign"),
    ("Campaign", "plan", "campaigns.plan"),
    ("Campaign", "review", "findings.review"),
    ("Campaign", "diagnose", "findings.diagnose"),
    ("Campaign", "sure", "findings.sure"),
    ("Campaign", "triage", "triage.triage"),
    ("Campaign", "history", "triage.history"),
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
package. A command's module is imported only when that command is called, so a new command does not slow the others."""


class _Commands(TyperGroup):
    """The commands of `COMMANDS` and those of other packages; each is built on first use."""

    def __init__(self, **settings: Any) -> None:  # noqa: ANN401 - typer's own, passed on
        super().__init__(**settings)
        # These are the names that "did you mean" may suggest.
        self.commands = dict.fromkeys(self._table, cast("Any", None))
        self._looked = False

    _table = MappingProxyType({name: (panel, function) for panel, name, function in COMMANDS})

    def list_commands(self, ctx: Any) -> list[str]:  # noqa: ANN401 - a type that typer keeps to itself
        """Return the names of all commands, those of this package first."""
        self._look()
        return super().list_commands(ctx)

    def get_command(self, ctx: object, cmd_name: str) -> Any:  # noqa: ANN401 - as above
        """Return a command, or None if there is none of this name; a command of another package is returned only as its
        line in the help.
        """
        del ctx
        if cmd_name not in self._table:
            return self.commands.get(cmd_name)
        panel, function = self._table[cmd_name]
        module, _, attribute = f"foresee_dsl.cli.{function}".rpartition(".")
        if self.commands[cmd_name] is None:
            call = getattr(import_module(module), attribute)
            grouped = isinstance(call, typer.Typer)
            self.commands[cmd_name] = _group(call, panel) if grouped else _alone(call, cmd_name, panel)
        return self.commands[cmd_name]

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:  # noqa: ANN401 - as above
        """Return the command that the arguments name; only here is a command of another package imported."""
        if args[0] in self._table:
            return super().resolve_command(ctx, args)
        from foresee_dsl.cli.added import ADDED, CommandError, load_command

        self._look()
        if args[0] not in self.commands and (missing := ADDED.beside(args[0])):
            ctx.fail(f"The command {args[0]!r} {missing}.")
        name, command, rest = super().resolve_command(ctx, args)
        if name is not None:
            try:
                with ADDED.loading(ADDED.find(name)):
                    command = _alone(load_command(name), name, PLUG_INS)
            except CommandError:
                if not ctx.resilient_parsing:  # a shell that asks for completions gets no error message
                    raise
        return name, command, rest

    def _look(self) -> None:
        """Read once which commands other packages add."""
        if not self._looked:
            from foresee_dsl.cli.added import ADDED, help_of

            self._looked = True
            names = (name for name in ADDED.names() if name not in self._table)
            self.commands.update({name: _Listed(name, help_of(name)) for name in names})

    def format_help(self, ctx: Any, formatter: Any) -> None:  # noqa: ANN401 - as above
        """Print the help, and a warning for each refused command of another package."""
        from foresee_dsl.cli.added import clashes

        super().format_help(ctx, formatter)
        for sentence in clashes(frozenset(self._table)):
            typer.echo(f"warning: {sentence}", err=True)


class _Listed(TyperCommand):
    """A command of another package as help and completions list it: its package is not imported."""

    def __init__(self, name: str, about: str) -> None:
        super().__init__(name, rich_help_panel=PLUG_INS, help=about)


PLUG_INS = "Plug-ins"
"""The group of the help that lists the commands of other packages."""


def _alone(call: Callable[..., None], name: str, panel: str) -> Any:  # noqa: ANN401 - as above
    alone = typer.Typer(add_completion=False, rich_markup_mode="rich", context_settings=SETTINGS)
    alone.command(name=name, cls=ForeseeCommand, rich_help_panel=panel)(for_tools(call, name))
    return typer.main.get_command(alone)


def _group(group: typer.Typer, panel: str) -> Any:  # noqa: ANN401 - as above
    """Return a command with subcommands, such as `import`; its module defines them as a `typer.Typer`."""
    command = typer.main.get_group(group)
    command.rich_help_panel = panel
    return command


app = typer.Typer(
    name="foresee",
    cls=_Commands,
    help="Write traffic situations as text, drive your software through them, "
    "and find the failures behind the near misses.",
    epilog="A test case is addressed like a pytest node: [cyan]scenarios/scenario7.foresee::r03[/cyan]. "
    "Exit codes: 0 nothing failed, 1 failures were found or the input has errors, 2 wrong usage, 3 an "
    "internal error of foresee.",
    no_args_is_help=True,
    rich_markup_mode="rich",
    pretty_exceptions_enable=False,
    add_completion=VARIABLE in os.environ,
    context_settings=SETTINGS,
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
            help="Raise a limit on one input's use of the machine; the error message names the limit.",
        ),
    ] = None,
) -> None:
    """Apply the options that stand before a command; `--version` prints the version and exits in its callback."""
    del version
    if limit:
        from foresee_dsl.limits import allow

        allow(limit)


def main() -> None:
    """Run the command line and exit with its exit code; a user's error never ends in a traceback."""
    # A short command mostly imports, which creates many objects and no garbage: a higher threshold saves a tenth of its
    # time.
    gc.set_threshold(100_000)
    # Pydantic 2.14 would search all installed packages for plug-ins of its own, 2 % of a check's time. A user that has
    # such a plug-in sets the variable to nothing.
    os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")
    guard_streams()
    warnings.formatwarning = lambda message, *_, **__: f"warning: {message}\n"
    try:
        try:
            app()
        finally:
            sys.stdout.flush()  # a closed pipe is noticed here, not when the interpreter ends
    except KeyboardInterrupt:
        sys.exit(130)
    except Exception as error:
        code = explain_error(error)
        if code == BUG and os.environ.get("FORESEE_DEBUG"):
            raise
        sys.exit(code)
    finally:
        # The process ends: a last search for garbage among all imported objects would take a seventh of a check's time.
        gc.freeze()
