"""Output for other tools: named JSON documents, reports for build servers, errors as data, and `--output FILE`.

Every command that prints JSON passes through `for_tools`, which adds `--output FILE`, puts the document's name beside
its schema number, and prints an error in the input as a JSON document too.
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


def format_option(help: str, *ours: str) -> Any:  # noqa: ANN401 - typer's own type
    """Return the option `--format` of a command, with the human-readable format first. It also accepts the formats of
    other packages, which are only searched if a name is not among `ours`."""

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
ComparisonFormatOption = Annotated[
    str,
    format_option("text: for a terminal; markdown: for a pull request; json: for tools.", "text", "markdown", "json"),
]
JunitOption = Annotated[Path | None, typer.Option("--junit", metavar="FILE", help="Also write JUnit XML to this file.")]
_OutputOption = Annotated[
    Path | None,
    typer.Option(
        "--output",
        metavar="FILE",
        help="Write the JSON or the other format for tools to this file, not to standard output.",
    ),
]


def for_tools(command: Callable[..., None], name: str) -> Callable[..., None]:
    """Return a command with the option `--output`, which also reports errors as JSON if JSON was requested. A command
    without output for tools is returned unchanged.

    Typer reads a function's signature, so the option is added to the signature.
    """
    parameters = dict(inspect.signature(command, eval_str=True).parameters)
    forms = [option for option in ("json", "format", "format_") if option in parameters]
    if not forms:
        return command

    def run(**values: Any) -> None:  # noqa: ANN401 - as typer gives them
        output = values.pop("output", None)
        as_json = any(values[form] is True or values[form] == "json" for form in forms)
        people = not as_json and all(values[form] in (False, *PEOPLE) for form in forms)
        with common.calling(common.Call(name, output)), _into(output if people else None):
            try:
                command(**values)
            except (ForeseeError, OSError) as error:
                if not as_json:
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
    """Write everything that is printed inside this context to the file, even after an error; None: print as usual."""
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
    """Print a command's results in the requested format, and write JUnit XML to the file of `--junit`.

    The human-readable report goes to standard output if it is the requested format, or if `--output` names a file for
    the other format, unless that is one of the command's own forms. GitHub annotations use standard output, so with
    them the report goes to standard error.

    Args:
        people: prints the human-readable report.
    """
    if junit is not None:
        from foresee_dsl.files import write_whole

        write_whole(junit, rendered("junit", report))
    if form in PEOPLE or (common.CALL.get().output is not None and form not in report.forms):
        people(common.console())
    elif form == "github":
        people(common.console(error=True))
    if form not in PEOPLE:
        common.give(rendered(form, report))


def _error_document(error: ForeseeError | OSError) -> dict[str, Any]:
    """Return an error in the input as a document in the shape of `check --json`: `ok` is false, and the reasons."""
    place = f"{error.filename}: " if isinstance(error, OSError) and error.filename else ""
    message = (error.strerror or str(error)) if isinstance(error, OSError) else str(error)
    diagnostics = error.diagnostics if isinstance(error, InputError) else ()
    return {"ok": False, "message": f"{place}{message}", "diagnostics": diagnostics}
