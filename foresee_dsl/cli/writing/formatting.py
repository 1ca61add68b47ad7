"""The command `fmt`: brings files into the standard layout, or lists the files that are not in it."""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

import typer

from foresee_dsl.cli.options.common import FAILED, print_diagnostics
from foresee_dsl.errors import Diagnostic, InputError

_STDIN = "-"
_HEADER_LINES = 2
"""Number of lines with the file's name, `---` and `+++`, at the beginning of a unified diff."""
_COLOURS = {"+": typer.colors.GREEN, "-": typer.colors.RED, "@": typer.colors.CYAN}


@dataclass
class _Tally:
    """Counts of files that were read and changed, and the errors of the others."""

    files: int = 0
    changed: int = 0
    mistakes: dict[Diagnostic, None] = field(default_factory=dict)  # a dictionary as an ordered set


def fmt(
    paths: Annotated[
        list[str],
        typer.Argument(metavar="PATH", help="Files and folders; `-` formats standard input to standard output."),
    ],
    check_only: Annotated[
        bool, typer.Option("--check", help="Change no file; exit with 1 if a file is not in the standard layout.")
    ] = False,
    show_diff: Annotated[
        bool, typer.Option("--diff", help="Change no file; print what would change, and exit as with --check.")
    ] = False,
) -> None:
    """Format files in the standard layout: comments and grouping stay, the meaning never changes.

    A file with errors is not changed and its errors are shown; the others are formatted.

    [dim]foresee fmt scenarios
    foresee fmt --check .
    cat x.foresee | foresee fmt -[/dim]
    """
    if _STDIN in paths:
        if len(paths) > 1:
            raise typer.BadParameter("`-` (standard input) cannot be combined with other paths")
        _format_stdin(check_only=check_only, show_diff=show_diff)
        return
    tally = _Tally()
    for file in _files(paths, tally):
        try:
            _format_file(file, tally, check_only=check_only, show_diff=show_diff)
        except InputError as error:
            tally.mistakes |= dict.fromkeys(error.diagnostics)
        except OSError as error:
            message = f"this file cannot be written: {(error.strerror or str(error)).lower()}"
            help = "check the permissions of the file and its folder"
            tally.mistakes[Diagnostic("FS001", message, help, str(file))] = None
    if tally.mistakes:
        print_diagnostics(tuple(tally.mistakes))
    elif not tally.changed:
        typer.echo("1 file is formatted already" if tally.files == 1 else f"{tally.files} files are formatted already")
    if tally.mistakes or (tally.changed and (check_only or show_diff)):
        raise typer.Exit(FAILED)


def _files(paths: Sequence[str], tally: _Tally) -> Iterator[Path]:
    """Yield each file once; a missing path is an error like any other."""
    from foresee_dsl.language.project.addresses import scenario_files

    seen: set[str] = set()
    for path in paths:
        try:
            files = scenario_files([path])
        except InputError as error:
            tally.mistakes |= dict.fromkeys(error.diagnostics)
            continue
        for file in files:
            key = os.path.abspath(file)  # noqa: PTH100  (a key: no links followed)
            if key not in seen:
                seen.add(key)
                yield file


def _format_file(file: Path, tally: _Tally, *, check_only: bool, show_diff: bool) -> None:
    from foresee_dsl.files import write_whole
    from foresee_dsl.language.parser import read_text

    tally.files += 1
    before = read_text(file, str(file))
    after = _formatted(before, str(file))
    if after == before:
        return
    tally.changed += 1
    if show_diff:
        _print_diff(before, after, str(file))
    elif check_only:
        typer.echo(f"would change {file}")
    else:
        target = file.resolve()  # the target of a link is written, so that the link remains a link
        if not os.access(target, os.W_OK):  # replacing the file would ignore its permissions
            raise PermissionError(13, "permission denied")
        write_whole(target, after)
        typer.echo(f"formatted {file}")


def _format_stdin(*, check_only: bool, show_diff: bool) -> None:
    from foresee_dsl.language.parser import MAX_BYTES, decode

    before = decode(sys.stdin.buffer.read(MAX_BYTES + 1), "<stdin>")
    after = _formatted(before, "<stdin>")
    if show_diff:
        _print_diff(before, after, "<stdin>")
    elif check_only:
        typer.echo("<stdin> is formatted already" if after == before else "would change <stdin>")
    else:
        # Bytes are written, because neither the locale nor the system changes them.
        sys.stdout.buffer.write(after.encode("utf-8"))
        sys.stdout.buffer.flush()
    if after != before and (check_only or show_diff):
        raise typer.Exit(FAILED)


def _formatted(text: str, name: str) -> str:
    """Return a text in the standard layout, with the newlines of its first line and without a byte order mark.

    Raises:
        InputError: the text has errors.
    """
    from foresee_dsl.language.parser import format_text

    result = format_text(text, name)
    first = text.find("\n")
    return result.replace("\n", "\r\n") if first > 0 and text[first - 1] == "\r" else result


def _print_diff(before: str, after: str, name: str) -> None:
    """Print a unified diff, in colour on a terminal (`typer.echo` takes colours out elsewhere)."""
    import difflib

    coloured = "NO_COLOR" not in os.environ
    # Split behind each newline: `str.splitlines` also splits at characters that may stand in a string.
    old, new = (re.findall(r"[^\n]*\n|[^\n]+", text) for text in (before, after))
    for k, line in enumerate(difflib.unified_diff(old, new, name, name)):
        text, newline, _ = line.partition("\n")
        if coloured and k < _HEADER_LINES:
            text = typer.style(text, bold=True)
        elif coloured and line[0] in _COLOURS:
            text = typer.style(text, fg=_COLOURS[line[0]])
        typer.echo(text + (newline or "\n\\ No newline at end of file\n"), nl=False)
