"""The records of a parsed file, with the places of its items and its comments, and of a test case that is ready to
compile."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from foresee_dsl.errors import Diagnostic, Message, MessageText, Span
from foresee_dsl.helps import HelpText
from foresee_dsl.language import model as m
from foresee_dsl.language.codes import diagnostic_of
from foresee_dsl.notebooks import Displayed

Key = tuple[str | int, ...]
"""The path of a statement in the model."""
HEADER: Key = ("header",)
"""The key of the line `foresee 1`."""
END: Key = ("end",)
"""The key of the comments after the last brace."""


@dataclass(frozen=True)
class Comments:
    """Comments and blank lines around one statement.

    `before`: comment texts (without `#` and the space after it) on lines of their own; an empty string is a blank line
    between comments.
    `blank_before`: True if a blank line stands in front. `after`: the comment at the end of the statement's first line.
    `at_end`: comments before the closing brace of a block. `after_end`: the comment behind that brace.
    """

    before: tuple[str, ...] = ()
    blank_before: bool = False
    after: str | None = None
    at_end: tuple[str, ...] = ()
    after_end: str | None = None


@dataclass(frozen=True)
class Document:
    """One `.foresee` file that was read.

    `spans` maps `(id(item), field)` to a place in the file; the field "" stands for the whole statement. The items stay
    alive through `model`.
    `comments` maps a statement's path in the model (`("body", 3)`, `("body", 3, "actions", 0)`) to its comments; the
    path `()` is the definition itself, `("header",)` the line `foresee 1`, and `("end",)` what follows the last brace.
    A line that is one field of a statement (a road's `lanes 2`) has the field's name: `("body", 3, "lanes")`.
    """

    path: str
    text: str
    model: m.Definition
    spans: Mapping[tuple[int, str], Span] = field(default_factory=dict)
    comments: Mapping[Key, Comments] = field(default_factory=dict)
    base: Document | None = None
    """For a scenario that extends another, the document of the other. `model` is then the joined scenario, and
    `written` the definition in this file."""
    written: m.Definition | None = None
    calculates: bool = False
    """True if the file has expressions."""
    alive: tuple[m.Item, ...] = ()
    """Items that have an id in `spans` but are not in `model`. They are kept, because an id is unique only while its
    item exists."""

    def span(self, item: m.Item, name: str = "") -> Span | None:
        """Return the place of an item or one of its fields; of the whole item if the field has no place."""
        return self.spans.get((id(item), name)) or self.spans.get((id(item), ""))

    def diagnostic(
        self, item: m.Item | None, name: str, code: str, message: MessageText, help: HelpText = ""
    ) -> Diagnostic:
        """Return an error or a warning about an item of this file (None: about the file), as its code says.

        An error about an item that comes from the extended scenario is placed at `extends`, and names the line in the
        other file.
        """
        if item is not None and self.base is not None and (holder := self._holder(item)) is not self:
            place = holder.span(item, name)
            line = f", line {place.line}" if place is not None else ""
            message = message + f" (in '{holder.path}'{line})"
            item, name = self.written, "parent"
        span = self.span(item, name) if item is not None else None
        lines = self.text.split("\n")
        line = lines[span.line - 1] if span is not None and span.line <= len(lines) else ""
        return diagnostic_of(code, message, help, self.path, span, line)

    def _holder(self, item: m.Item) -> Document:
        """Return the document whose file contains an item: this document, or one that it extends."""
        return self if self.base is None or (id(item), "") in self.spans else self.base._holder(item)


@dataclass(frozen=True)
class TestCase(Displayed):
    """A concrete scenario with everything it needs, ready to compile.

    Attributes:
        id: its address: `scenarios/scenario7.foresee::r03`, or a clip's or mutant's file.
        scenario: a concrete scenario, without parameters, cases or references; in a clip or a mutant, every actor has a
            `State`.
        network: a network of the language, or the absolute path of a foreign `.net.xml` or `.xodr`.
        models: all models that may be named, by name (the bundled catalogue, then the file's own).
        meaning: `sha256:` and 12 digits, a hash of the scenario, the network, the tracks and the models that the
            scenario names, without comments, `doc`, tags, layout, file names and the case's name.
        source: the addressed file.
        document: the parsed file; None for a test case built in memory.
        network_document: the parsed file that holds its network; None for a foreign network, or without a file.
        clip, mutant: the definition in its file; None if the file has no such definition.
        tracks: the absolute path of the file with the recorded tracks of its actors; None without one.
        goal: label of the expectation whose violation is a failure of the run (the goal of the campaign that runs it or
            that found the mutant); "" for none. It is not part of the meaning.
        parent_ends_s: in a clip or a mutant, the time after which the run of the clip's parent ends at the latest, s.
    """

    __test__ = False  # pytest would collect this class by its name

    id: str
    scenario: m.Scenario = field(repr=False)
    network: m.Network | Path = field(repr=False)
    models: Mapping[str, m.VehicleModel] = field(repr=False)
    meaning: str
    source: Path
    document: Document | None = field(default=None, repr=False)
    network_document: Document | None = field(default=None, repr=False)
    clip: m.Clip | None = field(default=None, repr=False)
    mutant: m.Mutant | None = field(default=None, repr=False)
    tracks: Path | None = None
    goal: str = ""
    parent_ends_s: float = field(default=math.inf, repr=False)

    @property
    def snapshot(self) -> bool:
        """True if it begins from exact states: a clip, a mutant, or a file that `foresee expand` printed."""
        ego = self.scenario.first(m.Ego)
        return ego is not None and ego.state is not None

    @property
    def family(self) -> str:
        """The paper's family ("3", "4", "7", "8", "9"), or "" if the scenario has no such tag."""
        return self.scenario.family


def family_order(family: str) -> tuple[bool, int, str]:
    """Return the sort key of a family, in the order of the paper's table; the empty one (no tag) is last."""
    return (not family.isdigit(), int(family) if family.isdigit() else 0, family)


@dataclass(frozen=True)
class Problem:
    """An error that shows only once the network is known, such as an actor off the road or on top of another one.

    It is not yet a `Diagnostic`, because the compiler works on a concrete scenario and knows no text: it names the
    actor and the statement at fault, and problems that repeat another are left out before their places are looked up.

    `actor`: name of the actor, or "" for the scenario. `item`: the `kind` of the actor's statement that is at fault
    (`route`, `start_at`, `path`, ...), or "" for the actor as a whole. `about`: the name in that statement that is at
    fault, if there is one. `part`: the place or value that is at fault. `field`: the field that holds the name, needed
    if other fields of the statement may hold the same name. `compile.compiler.diagnose` turns it into a `Diagnostic`.
    """

    actor: str
    item: str
    code: str
    message: MessageText
    help: HelpText = ""
    about: str = ""
    part: m.Item | None = None
    field: tuple[str, str] = ("", "")
    """The kind of the item and its field that hold the name; "" for any."""

    @property
    def text(self) -> str:
        """The message as people read it."""
        return Message.of(self.message).text


class PlacementError(Exception):
    """Raised inside the compiler with all `Problem`s; `compile_test_case` turns it into an `InputError`."""

    def __init__(self, problems: tuple[Problem, ...]) -> None:
        super().__init__("; ".join(p.text for p in problems))
        self.problems = problems
