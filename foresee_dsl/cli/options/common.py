"""Code that commands share: exit codes, error messages, JSON, common options, and the selection of test cases."""

from __future__ import annotations

import csv
import json
import os
import sys
from collections import Counter
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer.core import TyperCommand

from foresee_dsl.cli.completion import drivers
from foresee_dsl.errors import Diagnostic, ForeseeError, InputError
from foresee_dsl.language.campaign_values import SEED, RulesMode
from foresee_dsl.report.formats import PEOPLE, CommandReport, rendered
from foresee_dsl.report.safe_text import counted

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from rich.console import Console

    from foresee_dsl.campaign.profiling.tasks import Profiler
    from foresee_dsl.language.document import TestCase

OK, FAILED, USAGE, BUG = 0, 1, 2, 3
"""Exit codes: nothing failed; failures were found or the input has errors; wrong usage; an internal error."""
SETTINGS = {"help_option_names": ["-h", "--help"]}
"""Click's settings of every command."""

_MOST_PROCESSES = 256


def jobs_option(about: str) -> Any:  # noqa: ANN401 - typer's own
    """Return the option `--jobs` with its text in `--help`."""
    return typer.Option("--jobs", min=1, max=_MOST_PROCESSES, help=about)


JsonOption = Annotated[bool, typer.Option("--json", help="Print JSON.")]
DriverOption = Annotated[
    str, typer.Option("--driver", help="The driver under test; `foresee drivers` lists them.", autocompletion=drivers)
]
HandoverOption = Annotated[
    float | None,
    typer.Option(
        "--handover",
        min=0,
        max=10,
        help="Seconds at a clip's beginning in which the ego follows its recorded states while the driver watches; by "
        "default the number that the driver requests, for most drivers 0.",
    ),
]
RankerOption = Annotated[
    str,
    typer.Option(
        "--ranker", help="Method that chooses the risky points: foresee, careful, reach, proximity, random, ..."
    ),
]
AllowOutsideOption = Annotated[
    bool, typer.Option("--allow-outside", help="Allow files to use other files outside the project folder.")
]
ProfileOption = Annotated[
    bool, typer.Option("--profile", help="Also report how much time the driver, SUMO and each part of the tool took.")
]
SeedOption = Annotated[int, typer.Option("--seed", min=SEED[0], max=SEED[1], help="Seed of all random choices.")]
RulesOption = Annotated[
    RulesMode,
    typer.Option(
        "--rules",
        help="What a traffic rule that the ego breaks means for a run that passes otherwise: it fails, it passes with "
        "a report, or rules are off.",
    ),
]
ExitZeroOption = Annotated[
    bool, typer.Option("--exit-zero", help="Exit with 0 even when failures are found; errors keep their exit codes.")
]
StepDeadlineOption = Annotated[
    float | None,
    typer.Option(
        "--step-deadline",
        min=0.05,
        max=3600,
        help="Wall time in seconds that the driver may take per step; by default 10 (external drivers: 1).",
    ),
]
DeadlineOption = Annotated[
    float | None,
    typer.Option(
        "--deadline",
        min=0.1,
        help="Wall time in seconds that a run may take; by default 60, plus 20 per simulated second.",
    ),
]
OutOption = Annotated[Path, typer.Option("--out", file_okay=False, help="The folder to write into.")]
PresetOption = Annotated[
    str,
    typer.Option("--preset", help="How clips are mutated: avoidable, focused, lawful, or paper (as the paper says)."),
]
FirstOption = Annotated[int | None, typer.Option("--first", min=1, help="Use only the first N test cases.")]
OnlyOption = Annotated[
    list[str] | None,
    typer.Option(
        "--only", metavar="FAMILY|TAG", help="Use only test cases of this family or tag; repeat the option for several."
    ),
]
FailFastOption = Annotated[bool, typer.Option("--fail-fast", help="Stop at the first failure.")]


def selected(cases: Sequence[TestCase], first: int | None, only: Sequence[str] | None) -> tuple[TestCase, ...]:
    """Return the test cases that the options select, in their order.

    Raises:
        BadParameter: no test case has such a family or tag.
    """
    chosen = tuple(cases)
    if only:
        words_of_case = {case.id: _words(case) for case in chosen}
        for word in only:
            if not any(word in words for words in words_of_case.values()):
                there = ", ".join(sorted(set().union(*words_of_case.values()))) or "none"
                raise typer.BadParameter(f"no test case has the family or tag {word!r}; the test cases have: {there}",
                                         param_hint="--only")  # fmt: skip
        chosen = tuple(case for case in chosen if words_of_case[case.id].intersection(only))
    return chosen[:first]


def _words(case: TestCase) -> set[str]:
    from foresee_dsl.language.model import Tags

    tags = case.scenario.first(Tags)
    return {*(tags.names if tags is not None else ()), *([case.family] if case.family else ())}


@contextmanager
def profiling() -> Iterator[Profiler]:
    """Measure the time that is spent inside this context, for `--profile`, and yield the profiler."""
    from foresee_dsl.campaign.profiling.tasks import Profiler

    profiler = Profiler()
    with profiler.command():
        yield profiler


ONE_OF_SEVERAL = ("--driver", "--ranker")
"""Options of which a campaign file can name several: two of them look as if both were used, but the last one would
silently replace the others."""


class ForeseeCommand(TyperCommand):
    """A command that may start programs which its options name as drivers, but not programs that files name.

    It refuses two values of an option of `ONE_OF_SEVERAL`; of any other option the last value counts, so that a script
    can add options to a command.
    """

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:  # noqa: ANN401 - a type that typer keeps to itself
        """Read the arguments; a usage error names an option of `ONE_OF_SEVERAL` that is given more than once."""
        rest = super().parse_args(ctx, list(args))
        if not ctx.resilient_parsing:  # a shell that asks for completions gets no error message
            times = Counter(parameter.opts[0] for parameter in self.make_parser(ctx).parse_args(list(args))[2]
                            if not parameter.multiple)  # fmt: skip
            for option in ONE_OF_SEVERAL:
                if times[option] > 1:
                    ctx.fail(f"{option} is given more than once, but it takes one value.")
        return rest

    def invoke(self, ctx: Any) -> Any:  # noqa: ANN401 - as above
        """Run the command, with consent to the programs that its options name."""
        from foresee_dsl.drivers.consent import allowing

        with allowing(_named_in_options(self, ctx)):
            return super().invoke(ctx)


def _named_in_options(command: TyperCommand, ctx: Any) -> Iterator[str]:  # noqa: ANN401 - as above
    """Yield each text passed as an option on the command line, whole and split at its commas.

    Arguments are left out: they are file names, which may come from another person.
    """
    for parameter in command.params:
        name = parameter.name or ""
        source = ctx.get_parameter_source(name)
        if parameter.param_type_name == "option" and source is not None and source.name == "COMMANDLINE":
            value = ctx.params.get(name)
            for text in value if isinstance(value, (list, tuple)) else (value,):
                if isinstance(text, str):
                    yield from (text, *names_in(text))


def names_in(text: str) -> tuple[str, ...]:
    """Return the names between commas, without duplicates; a name that contains a comma stands in double quotes."""
    names = next(csv.reader([text], skipinitialspace=True), [])
    return tuple(dict.fromkeys(name.strip() for name in names if name.strip()))


WIDEST = 160
"""Maximum width of a report, in columns. Ours: longer lines are hard to read."""
_NEVER_WRAPPED = 10_000


def console(*, error: bool = False) -> Console:
    """Return a rich console on standard output (or error); outside a terminal, it breaks no lines."""
    from foresee_dsl.cli.options.plain_output import harmless_console

    screen = harmless_console(error=error, soft_wrap=False, highlight=False)
    screen.width = min(screen.width, WIDEST) if screen.is_terminal else _NEVER_WRAPPED
    return screen


@dataclass(frozen=True)
class Call:
    """The running command: its name, the file of its `--output`, and the format of its report."""

    command: str
    output: Path | None = None
    form: str = PEOPLE[0]


CALL: ContextVar[Call] = ContextVar("CALL", default=Call(""))  # noqa: B039 - it is immutable


@contextmanager
def calling(call: Call) -> Iterator[None]:
    """Record inside this context which command runs."""
    token = CALL.set(call)
    try:
        yield
    finally:
        CALL.reset(token)


SCHEMA_NUMBERS = {"verify": 2}
"""Schema numbers of the documents whose number is not 1."""


def print_json(data: object, name: str = "") -> None:
    """Print one JSON document, or write it to the file of `--output`; with `--format` of another package, what that
    format makes of it."""
    call, document = CALL.get(), json_document(data, name)
    form = "json" if call.form in PEOPLE else call.form
    give(rendered(form, CommandReport(call.command, lambda: document)))


def json_document(data: object, name: str = "") -> str:
    """Return a record, or a mapping of keys to values, as JSON text (converted by `foresee_dsl.documents.plain`).

    The first keys are the schema's number and name (`docs/schemas/NAME-NUMBER.json`); by default the command's name.
    """
    from foresee_dsl.documents import plain

    name = name or CALL.get().command
    return json.dumps({"schema": SCHEMA_NUMBERS.get(name, 1), "document": name, **plain(data)}, indent=2) + "\n"


def give(text: str) -> None:
    """Print machine-readable text, or write it to the file of `--output`."""
    output = CALL.get().output
    if output is None:
        typer.echo(text, nl=False)
        return
    from foresee_dsl.files import write_whole

    write_whole(output, text)


def print_diagnostics(diagnostics: tuple[Diagnostic, ...]) -> None:
    """Print diagnostics on standard error, each with its place, the underlined line, and what to write instead."""
    from foresee_dsl.language.messages.diagnostics import render_all

    colour = sys.stderr.isatty() and "NO_COLOR" not in os.environ
    typer.echo(render_all(diagnostics, colour=colour) + "\n", err=True)
    errors = sum(d.severity == "error" for d in diagnostics)
    warnings = len(diagnostics) - errors
    parts = [counted(n, word) for n, word in ((errors, "error"), (warnings, "warning")) if n]
    typer.echo(", ".join(parts), err=True)


def explain_error(error: Exception) -> int:
    """Print on standard error what went wrong; return the exit code."""
    if isinstance(error, InputError):
        print_diagnostics(error.diagnostics)
        return FAILED
    if isinstance(error, ForeseeError):
        typer.echo(f"error: {error}", err=True)
        return FAILED
    if isinstance(error, OSError):
        place = f"{error.filename}: " if error.filename else ""
        typer.echo(f"error: {place}{error.strerror or error}", err=True)
        return FAILED
    typer.echo(
        "\n".join([f"foresee has a fault: {type(error).__name__}: {error}", *getattr(error, "__notes__", ())]), err=True
    )
    typer.echo("Please report it; FORESEE_DEBUG=1 shows where it happened.", err=True)
    return BUG
