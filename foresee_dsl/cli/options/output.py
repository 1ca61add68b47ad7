"""What tools get from a command: a JSON document with its name, reports for build servers, mistakes as data, a file.

Every command that prints JSON goes through `for_tools`: it gives `--output FILE`, puts the document's name beside its
schema number, and answers a mistake in the input with a document too.
"""

from __future__ import annotations

import inspect
import io
import json as jsonlib
from collections.abc import Callable, Sequence
from contextlib import contextmanager, redirect_stdout
from enum import StrEnum
from functools import update_wrapper
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, assert_never, cast

import typer

from foresee_dsl.cli.options import common
from foresee_dsl.cli.options.plain_output import PlainStream
from foresee_dsl.errors import ForeseeError, InputError

if TYPE_CHECKING:
    from collections.abc import Iterator

    from rich.console import Console

    from foresee_dsl.report.builds.case_results import CaseResult


class ReportFormat(StrEnum):
    """In what form results are printed."""

    text = "text"
    json = "json"
    junit = "junit"
    github = "github"
    sarif = "sarif"


FormatOption = Annotated[
    ReportFormat,
    typer.Option(
        "--format",
        help="text: for people; json: data; junit: XML for build servers; github: annotations; sarif: for code hosts.",
    ),
]
JunitOption = Annotated[Path | None, typer.Option("--junit", metavar="FILE", help="Also write JUnit XML to this file.")]
_OutputOption = Annotated[
    Path | None,
    typer.Option("--output", metavar="FILE", help="Write what tools read to this file, not to standard output."),
]


_FOR_PEOPLE = ("False", "text", "full", "table")
"""The values of `--json` and `--format` that stand for people's form."""


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
        people = not asked and all(str(values[form]) in _FOR_PEOPLE for form in forms)
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
    form: ReportFormat,
    *,
    results: Callable[[], Sequence[CaseResult]],
    data: Callable[[], str],
    people: Callable[[Console], None],
    junit: Path | None = None,
    properties: Sequence[tuple[str, str]] = (),
) -> None:
    """Give a command's results in the form that was asked for, and as JUnit XML in the file of `--junit`.

    People's report goes to standard output, beside a file of `--output` too; where a tool reads standard output,
    nothing else goes there, and annotations have it on standard error.

    Args:
        results: each test case and child. data: the JSON document, as text. people: prints the report.
        properties: of the JUnit document, such as the driver.
    """
    call = common.CALL.get()
    if junit is not None:
        from foresee_dsl.files import write_whole
        from foresee_dsl.report.builds.junit import to_junit

        write_whole(junit, to_junit(f"foresee {call.command}", results(), properties=properties))
    if form is ReportFormat.text or call.output is not None:
        people(common.console())
    elif form is ReportFormat.github:
        people(common.console(error=True))
    if form is not ReportFormat.text:
        common.give(_rendered(form, f"foresee {call.command}", results, data, properties))


def _rendered(
    form: ReportFormat,
    name: str,
    results: Callable[[], Sequence[CaseResult]],
    data: Callable[[], str],
    properties: Sequence[tuple[str, str]],
) -> str:
    match form:
        case ReportFormat.json:
            return data()
        case ReportFormat.junit:
            from foresee_dsl.report.builds.junit import to_junit

            return to_junit(name, results(), properties=properties)
        case ReportFormat.github | ReportFormat.sarif:
            from foresee_dsl.report.builds.case_results import as_diagnostics, rules
            from foresee_dsl.report.builds.github import render_github
            from foresee_dsl.report.builds.sarif import to_sarif

            found = list(as_diagnostics(results()))
            if form is ReportFormat.github:
                return "".join(f"{line}\n" for line in render_github(found, rules()).splitlines())
            return jsonlib.dumps(to_sarif(found, rules()), indent=2) + "\n"
        case ReportFormat.text:  # people's, which `report_results` printed
            return ""
        case _:
            assert_never(form)


def _error_document(error: ForeseeError | OSError) -> dict[str, Any]:
    """A mistake in what was given, in the shape of `check --json`: `ok` is false, and why."""
    place = f"{error.filename}: " if isinstance(error, OSError) and error.filename else ""
    message = (error.strerror or str(error)) if isinstance(error, OSError) else str(error)
    diagnostics = error.diagnostics if isinstance(error, InputError) else ()
    return {"ok": False, "message": f"{place}{message}", "diagnostics": diagnostics}
