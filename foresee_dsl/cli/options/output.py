"""Output for other tools: named JSON documents, reports for build servers, errors as data, and `--output FILE`.

Every command that reports passes through `for_tools`, which completes `--format`, `--json` and `--output FILE`, puts
the document's name beside its schema number, and prints an error in the input as a JSON document too.
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
from typer.models import OptionInfo

from foresee_dsl.cli.options import common
from foresee_dsl.cli.options.plain_output import PlainStream
from foresee_dsl.errors import ForeseeError, InputError
from foresee_dsl.report.formats import OURS, PEOPLE, REPORT_FORMATS, CommandReport, rendered

if TYPE_CHECKING:
    from collections.abc import Iterator

    from rich.console import Console


class _FormatInfo(OptionInfo):
    """The option `--format` of a report, which `for_tools` tells apart from an exporter's option of this name."""


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

    return _FormatInfo(
        default=...,  # as typer.Option has it: the default is that of the parameter
        param_decls=("--format",),
        help=help,
        metavar=f"<{'|'.join(ours)}>",
        callback=checked,
        autocompletion=completed,
    )


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
RecordFormatOption = Annotated[str, format_option("text: for people; json: for tools.", "text", "json")]
"""For a command without results of test cases; a command with `json: JsonOption` gets it by itself."""
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
    """Return a command with the options `--format`, `--json` (the same as `--format json`) and `--output`, which also
    reports errors as JSON if JSON was requested. A command without output for tools is returned unchanged.

    A command declares one of two parameters, and gets the option of the other one beside it:

    - `format_: FormatOption`, or another `format_option`: the requested format;
    - `json: JsonOption`: whether data are requested, which `print_json` then prints in that format. A command with a
      `--format` of its own, such as an exporter's, keeps it and has `--json` alone.

    Typer reads a function's signature, so the options are added to the signature.
    """
    parameters = dict(inspect.signature(command, eval_str=True).parameters)
    own = next((name for name, parameter in parameters.items() if isinstance(_info(parameter), _FormatInfo)), "")
    if not own and "json" not in parameters:
        return command
    option_name = own or ("" if any(map(_takes_format, parameters.values())) else "format")

    def run(**values: Any) -> None:  # noqa: ANN401 - as typer gives them
        output, json, form = values.pop("output", None), values.pop("json"), values.pop(option_name, "text")
        form = "json" if json else form
        declared = {own: form, "json": json if own else form not in PEOPLE}
        values |= {option: value for option, value in declared.items() if option in parameters}
        with common.calling(common.Call(name, output, form)), _into(output if form in PEOPLE else None):
            try:
                command(**values)
            except (ForeseeError, OSError) as error:
                if form != "json":
                    raise
                common.print_json(_error_document(error), "error")
                raise typer.Exit(common.FAILED) from error

    options = list(parameters.values())
    if not own and option_name:
        options.insert(list(parameters).index("json"), _parameter(option_name, RecordFormatOption, "text"))
    if "json" not in parameters:
        before = "junit" if "junit" in parameters else own
        options.insert(list(parameters).index(before) + 1, _parameter("json", common.JsonOption, False))
    if "output" not in parameters:
        options.append(_parameter("output", _OutputOption, None))
    options = [option.replace(kind=inspect.Parameter.KEYWORD_ONLY) for option in options]
    update_wrapper(run, command)
    run.__signature__ = inspect.Signature(options)  # type: ignore[attr-defined]  # functions may have one
    run.__annotations__ = {option.name: option.annotation for option in options}
    return run


def _parameter(name: str, kind: Any, default: object) -> inspect.Parameter:  # noqa: ANN401 - a type with its option
    return inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, annotation=kind, default=default)


def _info(parameter: inspect.Parameter) -> OptionInfo | None:
    """Return the declaration of an option; None for a parameter without one."""
    declared = (*getattr(parameter.annotation, "__metadata__", ()), parameter.default)
    return next((info for info in declared if isinstance(info, OptionInfo)), None)


def _takes_format(parameter: inspect.Parameter) -> bool:
    """Return whether a command uses the name `format` or the flag `--format` for something else."""
    info = _info(parameter)
    return parameter.name == "format" or (info is not None and "--format" in (info.default, *(info.param_decls or ())))


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
