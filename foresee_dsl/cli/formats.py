"""The groups `foresee import` and `foresee export`, which have a command for each registered format.

A format is an entry point of the group `foresee_dsl.importers` or `foresee_dsl.exporters`: a function as described in
`foresee_dsl.exchange.protocol`. Its module is imported when its command runs or its help is requested.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable
from dataclasses import MISSING, Field, dataclass, fields
from typing import Annotated, Any, cast, get_args, get_type_hints

import typer
from typer.core import TyperGroup

from foresee_dsl.cli.options.common import SETTINGS, ForeseeCommand, JsonOption, console, print_json
from foresee_dsl.cli.options.output import for_tools
from foresee_dsl.exchange.outcome import ExchangeError, Imported
from foresee_dsl.exchange.protocol import Format, Option, Tell, options_of
from foresee_dsl.plugins import PluginGroup
from foresee_dsl.report.safe_text import counted

_OURS = {"json", "output"}
"""Options that every format's command has in addition to its own."""


class _Formats(TyperGroup):
    """The commands of a group of plug-ins; each is built on first use."""

    plugins: PluginGroup
    document: str
    """Name of the JSON document that these commands print."""

    def __init__(self, **settings: Any) -> None:  # noqa: ANN401 - typer's own, passed on
        super().__init__(**settings)
        # Formats of missing plug-ins are listed too, and say how to install them.
        names = sorted({*self.plugins.names(), *self.plugins.missing()})
        self.commands = dict.fromkeys(names, cast("Any", None))  # the names that "did you mean" may suggest

    def get_command(self, ctx: object, cmd_name: str) -> Any:  # noqa: ANN401 - a type that typer keeps to itself
        """Return the command of a format, or None if there is none of this name."""
        del ctx
        if cmd_name not in self.commands:
            return None
        call, settings = self._command(cmd_name)
        alone = typer.Typer(add_completion=False, rich_markup_mode="rich", context_settings=SETTINGS | settings)
        alone.command(name=cmd_name, cls=ForeseeCommand)(for_tools(call, self.document))
        return typer.main.get_command(alone)

    def _command(self, name: str) -> tuple[Callable[..., None], dict[str, Any]]:
        """Return the command of a format, and click's settings for it.

        If the format cannot be loaded, the command takes any options, and its help and its error say why.
        """
        try:
            with self.plugins.loading(self.plugins.find(name)):
                return _command(self.plugins.load(name)), {}
        except ExchangeError as err:
            fault = err

        def broken(options: _NoOptions, tell: Tell) -> Imported:
            del options, tell
            raise fault

        broken.__doc__ = str(fault).replace("[", r"\[")  # rich would read `[exchange]` as a style
        return _command(broken), {"allow_extra_args": True, "ignore_unknown_options": True}


@dataclass(frozen=True)
class _NoOptions:
    """The options of a format that cannot be loaded: it has none."""


class _Importers(_Formats):
    plugins = PluginGroup("foresee_dsl.importers", "importer", ExchangeError)
    document = "import"


class _Exporters(_Formats):
    plugins = PluginGroup("foresee_dsl.exporters", "exporter", ExchangeError)
    document = "export"


def _command(run: Format[Any]) -> Callable[..., None]:
    """Return a command that calls a format's function and prints what it wrote; it has the format's options and
    `--json`, to which `for_tools` adds `--format`.

    Typer reads a function's signature, so the signature is built from the fields of the options.
    """
    kind = options_of(run)
    if ours := sorted({field.name for field in fields(kind)} & _OURS):
        raise ExchangeError(
            f"{kind.__qualname__}: every format has the options {' and '.join(ours)}; rename the fields"
        )

    def command(*, json: bool, **values: Any) -> None:  # noqa: ANN401 - the values of the options' fields
        from foresee_dsl.report.terminal.steps import steps

        try:
            options = kind(**values)
        except ValueError as err:
            raise typer.BadParameter(str(err)) from err
        with steps(console(error=True)) as tell:
            done = run(options, tell)
        _print_outcome(done, json=json)

    hints = get_type_hints(kind, include_extras=True)
    parameters = [_parameter(field, hints[field.name]) for field in fields(kind) if field.init]
    parameters.append(inspect.Parameter("json", inspect.Parameter.KEYWORD_ONLY, default=False, annotation=JsonOption))
    command.__doc__ = run.__doc__
    command.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
    command.__annotations__ = {parameter.name: parameter.annotation for parameter in parameters} | {"return": None}
    return command


def _parameter(field: Field[Any], hint: Any) -> inspect.Parameter:  # noqa: ANN401 - any type
    """Return a field of a format's options as a typer parameter."""
    kind, *extras = get_args(hint) if hasattr(hint, "__metadata__") else (hint,)
    option = next((extra for extra in extras if isinstance(extra, Option)), Option())
    settings: dict[str, Any] = {
        "help": option.help or None,
        "metavar": option.metavar,
        "min": option.least,
        "max": option.most,
    }
    info = typer.Argument(**settings) if option.positional else typer.Option(*option.flags, **settings)
    default = field.default_factory() if field.default_factory is not MISSING else field.default
    return inspect.Parameter(
        field.name,
        inspect.Parameter.KEYWORD_ONLY,
        annotation=Annotated[kind, info],
        default=inspect.Parameter.empty if default is MISSING else default,
    )


def _print_outcome(done: Imported, *, json: bool) -> None:
    if json:
        print_json(done)
        return
    for file in done.files:
        typer.echo(f"wrote {file}")
    if done.cases:
        typer.echo(counted(done.cases, "test case"))
    for title, counts in (("taken over", done.taken), ("not expressed", done.left_out), ("lost", done.lost)):
        if counts:
            typer.echo(f"{title}:")
            for what, count in counts.items():
                typer.echo(f"  {count} {what}")
    for note in done.notes:
        typer.echo(f"note: {note}")


_LOOK: dict[str, Any] = {
    "no_args_is_help": True,
    "rich_markup_mode": "rich",
    "add_completion": False,
    "context_settings": SETTINGS,
}
import_ = typer.Typer(
    name="import", cls=_Importers, help="Turn files of other tools into networks and scenarios.", **_LOOK
)
export = typer.Typer(
    name="export", cls=_Exporters, help="Write test cases, clips and mutants for other tools.", **_LOOK
)
