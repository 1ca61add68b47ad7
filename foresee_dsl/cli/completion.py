"""Shell completion: the command that prints a shell's script, and what is completed besides names of commands."""

from __future__ import annotations

from enum import StrEnum
from typing import Annotated

import typer

VARIABLE = "_FORESEE_COMPLETE"
"""The environment variable by which the shell's script asks for completions."""


class Shell(StrEnum):
    """The shells that there is a script for."""

    bash = "bash"
    zsh = "zsh"
    fish = "fish"


_BASH = """\
# Test cases have colons in them (FILE::CASE), at which bash would end a word.
COMP_WORDBREAKS=${COMP_WORDBREAKS//:}
"""


def completion(shell: Annotated[Shell, typer.Argument(metavar="SHELL", help="bash, zsh or fish.")]) -> None:
    """Print the script by which a shell completes commands, options, files, drivers and test cases (FILE::CASE).

    [dim]foresee completion bash >> ~/.bashrc
    foresee completion zsh >> ~/.zshrc
    foresee completion fish > ~/.config/fish/completions/foresee.fish[/dim]
    """
    from typer._completion_shared import get_completion_script

    script = get_completion_script(prog_name="foresee", complete_var=VARIABLE, shell=shell.value)
    typer.echo((_BASH if shell is Shell.bash else "") + script)


def case_addresses(incomplete: str) -> list[str]:
    """Return the addresses of a file's test cases that begin so; none before the file is whole: shells know files."""
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
    except (ForeseeError, OSError):  # half-written: there is nothing to offer, and a message would stand in the line
        return []
    return [f"{name}::{case}" for case in cases if case and case.startswith(begun)]


def drivers(incomplete: str) -> list[str]:
    """Return the installed drivers whose names begin so."""
    from foresee_dsl.drivers.registry import driver_names

    return [name for name in driver_names() if name.startswith(incomplete)]
