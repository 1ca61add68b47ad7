"""What tools get from a command: a JSON document with its name, reports for build servers, mistakes as data, a file.

Every command that prints JSON goes through `for_tools`: it gives `--output FILE`, puts the document's name beside its
schema number, and answers a mistake in the input with a document too.
"""

from __future__ import annotations

import inspect
import io
from collections.abc import Callable
from contextlib import contextmanager, redirect_stdout
from functools import update_wrapper
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, cast

import typer

from foresee_dsl.cli.options import common
from foresee_dsl.cli.options.plain_output import PlainStream
from foresee_dsl.errors import ForeseeError, InputError
from foresee_dsl.report.formats import OURS, PEOPLE, REPORT_FORMATS, CommandReport, rendered

if TYPE_CHECKING:
    from collections.abc import Iterator

    from rich.console import Console


def format_option(help: str, *ours: str) -> Any:  # noqa: ANN401 - as typer has it
    """Return the option `--format` of a command, people's form first; formats of other packages are offered too, which
    are looked for when a name is none of ours."""

    def others() -> list[str]:
        return [name for name in REPORT_FORMATS.names() if name not in (*ours, *OURS)]

    def checked(name: str) -> str:
        if name not in ours and name not in (every := (*ours, *others())):
            raise typer.BadParameter(f"{name!r} is not one of {', '.join(map(repr, every))}.")
        return name

    def completed() -> list[str]:
        return [*ours, *others()]

    metavar = f"<{'|'.join(ours)}>"
    return typer.Option("--format", help=help, metavar=metavar, callback=checked, autocompletion=completed)


FormatOption = Annotated[
    str,
    format_option(
        "text: for people; json: data; junit: XML for build servers; github: annotations; sarif: for code hosts.",
        "text", "json", "junit", "github", "sarif",
    ),
]  # fmt: skip
JunitOption = Annotated[Path | None, typer.Option("--junit", metavar="FILE", help="Also write JUnit XML to this file.")]
_OutputOption = Annotated[
    Path | None,
    typer.Option("--output", metavar="FILE", help="Write what tools read to this file, not to standard output."),
]


def for_tools(command: Callable[..., None], name: str) -> Callable[..., None]:
    """Return a command with `--output`, whose mistakes are JSON where JSON was asked for; others as they are.

    Typer reads a function's signature, so the option is added there.
    """
    parameters = dict(inspect.signature(command, eval_str=True).parameters)
    forms = [option for option in ("json", "format", "format_") if option in parameters]
    if not forms:
        return command

    def run(**values: Any) -> None:  # noqa: ANN401 - as typer gives them
        output = values.pop("output", None)
        asked = any(values[form] is True or values[form] == "json" for form in forms)
        people = not asked and all(values[form] in (False, *PEOPLE) for form in forms)
        with common.calling(common.Call(name, output)), _into(output if people else None):
            try:
                command(**values)
            except (ForeseeError, OSError) as error:
                if not asked:
                    raise
                common.print_json(_error_document(error), "error")
                raise typer.Exit(common.FAILED) from error

    option = inspect.Parameter("output", inspect.Parameter.KEYWORD_ONLY, annotation=_OutputOption, default=None)
    every = [parameter.replace(kind=inspect.Parameter.KEYWORD_ONLY) for parameter in parameters.values()]
    if "output" not in parameters:
        every.append(option)
    update_wrapper(run, command)
    run.__signature__ = inspect.Signature(every)  # type: ignore[attr-defined]  # functions may have one
    run.__annotations__ = {parameter.name: parameter.annotation for parameter in every}
    return run


@contextmanager
def _into(file: Path | None) -> Iterator[None]:
    """Write to the file, whole, what is printed within it on standard output, however it ends; None: print it."""
    if file is None:
        yield
        return
    from foresee_dsl.files import write_whole

    printed = io.StringIO()
    try:
        with redirect_stdout(cast("io.StringIO", PlainStream(printed))):
            yield
    finally:
        write_whole(file, printed.getvalue())


def report_results(
    form: str, report: CommandReport, *, people: Callable[[Console], None], junit: Path | None = None
) -> None:
    """Give a command's results in the form that was asked for, and as JUnit XML in the file of `--junit`.

    People's report goes to standard output, beside a file of `--output` too; where a tool reads standard output,
    nothing else goes there, and annotations have it on standard error.

    Args:
        people: prints the report.
    """
    if junit is not None:
        from foresee_dsl.files import write_whole

        write_whole(junit, rendered("junit", report))
    if form in PEOPLE or common.CALL.get().output is not None:
        people(common.console())
    elif form == "github":
        people(common.console(error=True))
    if form not in PEOPLE:
        common.give(rendered(form, report))


def _error_document(error: ForeseeError | OSError) -> dict[str, Any]:
    """A mistake in what was given, in the shape of `check --json`: `ok` is false, and why."""
    place = f"{error.filename}: " if isinstance(error, OSError) and error.filename else ""
    message = (error.strerror or str(error)) if isinstance(error, OSError) else str(error)
    diagnostics = error.diagnostics if isinstance(error, InputError) else ()
    return {"ok": False, "message": f"{place}{message}", "diagnostics": diagnostics}
