"""Shell completion: the command that prints a shell's script, and completion of test cases and drivers."""

from __future__ import annotations

from contextlib import redirect_stdout
from enum import StrEnum
from io import StringIO
from typing import Annotated

import typer

VARIABLE = "_FORESEE_COMPLETE"
"""The environment variable in which the shell's script requests completions."""


class Shell(StrEnum):
    """Shells for which there is a completion script."""

    bash = "bash"
    zsh = "zsh"
    fish = "fish"


_BASH = """\
# bash would end a word at the colons of a test case (FILE::CASE).
COMP_WORDBREAKS=${COMP_WORDBREAKS//:}
"""


def completion(
    ctx: typer.Context, shell: Annotated[Shell, typer.Argument(metavar="SHELL", help="bash, zsh or fish.")]
) -> None:
    """Print a shell's completion script for commands, options, files, drivers and test cases (FILE::CASE).

    [dim]foresee completion bash >> ~/.bashrc
    foresee completion zsh >> ~/.zshrc
    foresee completion fish > ~/.config/fish/completions/foresee.fish[/dim]
    """
    from typer.completion import get_completion_inspect_parameters, shell_complete

    get_completion_inspect_parameters()  # registers the shells: `foresee` itself has no `--show-completion`
    with redirect_stdout(StringIO()) as printed:
        shell_complete(ctx.find_root().command, {}, "foresee", VARIABLE, f"source_{shell.value}")
    # typer begins the script with an empty line, but zsh looks for `#compdef` in the first
    typer.echo((_BASH if shell is Shell.bash else "") + printed.getvalue().strip())


def case_addresses(incomplete: str) -> list[str]:
    """Return the addresses of a file's test cases that begin with this text; the shell itself completes file names."""
    from pathlib import Path

    from foresee_dsl.errors import ForeseeError
    from foresee_dsl.language.project.addresses import SUFFIX, kind_of

    name, _, begun = incomplete.partition("::")
    file = Path(name).expanduser()
    if not name.endswith(SUFFIX) or not file.is_file() or kind_of(file) != "scenario":
        return []
    from foresee_dsl.language.project.loading import load_test_cases

    try:
        cases = [case.id.partition("::")[2] for case in load_test_cases([file], allow_outside=True)]
    except (ForeseeError, OSError):  # half-written file: offer nothing, as a message would appear in the command line
        return []
    return [f"{name}::{case}" for case in cases if case and case.startswith(begun)]


def drivers(incomplete: str) -> list[str]:
    """Return the installed drivers whose names begin with this text."""
    from foresee_dsl.drivers.registry import DRIVERS

    return [name for name in DRIVERS.names() if name.startswith(incomplete)]
