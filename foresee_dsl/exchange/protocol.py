"""What a format is: a function from its options to what it wrote. The command line derives a command from it.

The options are a dataclass. A field that says no more than its type and default is an option of the field's name; an
`Option` in its annotation says more:

    @dataclass(frozen=True)
    class FleetOptions:
        file: Annotated[Path, Option("A table of vehicles.", positional=True)]
        out: OutFolder
        prefix: Annotated[str, Option("Put before each name.")] = ""


    def fleet(options: FleetOptions, tell: Tell) -> Imported: ...
"""

from __future__ import annotations

import inspect
from collections.abc import Callable
from dataclasses import dataclass, is_dataclass
from pathlib import Path
from typing import Annotated, Any, Protocol, TypeVar, get_type_hints

from foresee_dsl.exchange.outcome import ExchangeError, Imported

Tell = Callable[[str], None]
"""Is called at the beginning of each step that may take long, with what the step does: a user is shown it."""
OptionsT_contra = TypeVar("OptionsT_contra", contravariant=True)


class Format(Protocol[OptionsT_contra]):
    """An importer (files of another tool become networks and scenarios) or an exporter (the other way round).

    The first paragraph of its documentation is in the list of formats, all of it in the command's help.
    """

    def __call__(self, options: OptionsT_contra, tell: Tell) -> Imported:
        """Write files, and return which, and what could not be taken over.

        Raises:
            ForeseeError: a file has mistakes, or something cannot be written; `ExchangeError` for most. Exit code 1.
        """
        ...


@dataclass(frozen=True)
class Option:
    """How a field of a format's options is given on the command line.

    A `ValueError` from the dataclass's `__post_init__` is wrong usage: exit code 2.

    Attributes:
        help: one or two sentences.
        flags: as they are written (`--map`); by default the field's name. `--on/--off` for one that is true or false.
        metavar: what stands for the value in the help.
        positional: it is an argument, without a flag.
        least, most: of a number.
    """

    help: str = ""
    flags: tuple[str, ...] = ()
    metavar: str | None = None
    positional: bool = False
    least: int | None = None
    most: int | None = None


OutFolder = Annotated[Path, Option("The folder to write into.", ("--out",))]
"""The type of a field `out`."""
AllowOutside = Annotated[bool, Option("Files may use files outside the project folder.", ("--allow-outside",))]
"""The type of a field `allow_outside`: whether files may name files outside their project folder."""


def options_of(run: Format[Any]) -> type[Any]:
    """Return the dataclass of a format's options.

    Raises:
        ExchangeError: the function is not a `Format`.
    """
    parameters = list(inspect.signature(run).parameters)
    kind = get_type_hints(run).get("options")
    if parameters != ["options", "tell"] or not (isinstance(kind, type) and is_dataclass(kind)):
        raise ExchangeError(
            f"{getattr(run, '__qualname__', run)} is not a format: it takes ({', '.join(parameters)}), and needs a "
            "function of (options: A_DATACLASS, tell), as foresee_dsl.exchange.protocol says"
        )
    return kind
