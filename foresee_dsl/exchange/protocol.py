"""The definition of a format: a function from its options to a report. The command line derives a command from it.

The options are a dataclass. A field with only a type and a default becomes an option of the field's name; an `Option`
in its annotation adds more::

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
from foresee_dsl.language.campaign_values import SEED

Tell = Callable[[str], None]
"""A function that is called at the beginning of each step that may take long, with a description for the user."""
OptionsT_contra = TypeVar("OptionsT_contra", contravariant=True)


class Format(Protocol[OptionsT_contra]):
    """An importer (files of another tool become networks and scenarios) or an exporter (the reverse).

    The first paragraph of its docstring appears in the list of formats, the whole docstring in the command's help.
    """

    def __call__(self, options: OptionsT_contra, tell: Tell) -> Imported:
        """Write files; return which, and a report on the parts that could not be taken over.

        Raises:
            ForeseeError: a file has errors, or a file cannot be written; mostly `ExchangeError`. Exit code 1.
        """
        ...


@dataclass(frozen=True)
class Option:
    """A field of a format's options as it appears on the command line.

    A `ValueError` from the dataclass's `__post_init__` means wrong usage: exit code 2.

    Attributes:
        help: one or two sentences.
        flags: the flags (`--map`); by default the field's name. `--on/--off` for a truth value.
        metavar: placeholder for the value in the help.
        positional: it is an argument, without a flag.
        least, most: limits of a number.
    """

    help: str = ""
    flags: tuple[str, ...] = ()
    metavar: str | None = None
    positional: bool = False
    least: int | None = None
    most: int | None = None


OutFolder = Annotated[Path, Option("The folder to write into.", ("--out",))]
"""The type of a field `out`."""
AllowOutside = Annotated[
    bool, Option("Allow files to use other files outside the project folder.", ("--allow-outside",))
]
"""The type of a field `allow_outside`, an option that permits files to name files outside their project folder."""

RunAddresses = Annotated[list[str], Option("Mutants, clips or test cases.", metavar="FILE[::CASE]...", positional=True)]
"""The type of a field `addresses`: what an exporter runs."""
RunDriver = Annotated[
    str, Option("The driver; by default the one that a mutant records, otherwise pdm.", ("--driver",))
]
RunSeed = Annotated[
    int | None,
    Option("The seed; by default the one that a mutant records, otherwise 0.", least=SEED[0], most=SEED[1]),
]
"""The types of fields `driver` ("" by default) and `seed` (None by default) of an exporter that runs test cases."""


def options_of(run: Format[Any]) -> type[Any]:
    """Return the dataclass of a format's options.

    Raises:
        ExchangeError: the function is not a `Format`.
    """
    parameters = list(inspect.signature(run).parameters)
    kind = get_type_hints(run).get("options")
    if parameters != ["options", "tell"] or not (isinstance(kind, type) and is_dataclass(kind)):
        raise ExchangeError(
            f"{getattr(run, '__qualname__', run)} is not a format: it takes ({', '.join(parameters)}), but must "
            "take (options: A_DATACLASS, tell), as described in foresee_dsl.exchange.protocol"
        )
    return kind
