"""Re-pins stale derived files (clips and mutants): shows how a parent's edit affects each of them, and writes the new
pin if the file is still valid."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from enum import StrEnum
from pathlib import Path

from foresee_dsl.errors import Diagnostic, InputError, with_article
from foresee_dsl.files import absolute, read_outside, write_whole
from foresee_dsl.language import model as m
from foresee_dsl.language.diff.addresses import diff_cases
from foresee_dsl.language.diff.parts import Difference
from foresee_dsl.language.diff.rendering import render_groups
from foresee_dsl.language.document import Document, TestCase
from foresee_dsl.language.meaning import clip_pin, pin_of
from foresee_dsl.language.messages.diagnostics import render_all
from foresee_dsl.language.parser import load
from foresee_dsl.language.project.addresses import display_path, is_folder, kind_of, mistake, scenario_files
from foresee_dsl.language.project.expand import expand_clip, expand_mutant
from foresee_dsl.language.project.loading import Project
from foresee_dsl.language.repinning.history import History

Validate = Callable[[TestCase], Sequence[Diagnostic]]
"""Returns the errors of a test case on its built network; the command line passes the compiler's check."""


class PinState(StrEnum):
    """State of a derived file, which determines what can be done."""

    FRESH = "fresh"
    """The pin is up to date."""
    STALE = "stale"
    """The parent changed, and the derived file is valid with the new pin."""
    CONFLICT = "conflict"
    """The parent changed so that the derived file is no longer valid; it is not re-pinned."""
    BLOCKED = "blocked"
    """The parent is stale too, and is not or cannot be re-pinned."""


@dataclass(frozen=True)
class DerivedFile:
    """A clip or a mutant, and the effect of its parent's edit on it.

    Attributes:
        file: the path as the user named it; for a file found in a named file's folder, that folder with the file's
            name.
        state: decides what can be done.
        parent: the parent's address.
        pin: the pin in the file.
        new_pin: the hash of the parent's present meaning; "" if the parent cannot be read.
        follows: True if the pin changes only because the parent is itself re-pinned.
        commit: the commit with the pinned version; "" if unknown.
        reaching: differences between the derived file under the old parent and under the new one.
        overridden: changes of the parent that do not reach the derived file, because it has its own statement.
        mistakes: reasons for a conflict or a block.
        old, new: the full scenario of the derived file under the old parent (if known) and the new one.
    """

    file: Path
    state: PinState
    parent: str
    pin: str
    new_pin: str = ""
    follows: bool = False
    commit: str = ""
    reaching: tuple[Difference, ...] = ()
    overridden: tuple[Difference, ...] = ()
    mistakes: tuple[Diagnostic, ...] = ()
    old: TestCase | None = field(default=None, compare=False, repr=False)
    new: TestCase | None = field(default=None, compare=False, repr=False)
    document: Document | None = field(default=None, compare=False, repr=False)

    def as_document(self) -> dict[str, object]:
        """Return its JSON document."""
        return {
            "file": self.file,
            "state": self.state,
            "parent": self.parent,
            "pin": self.pin,
            "new_pin": self.new_pin,
            "follows": self.follows,
            "commit": self.commit,
            "reaching": self.reaching,
            "overridden": self.overridden,
            "mistakes": self.mistakes,
        }

    @property
    def has_old_parent(self) -> bool:
        """True if git has the pinned version of the parent."""
        return self.follows or bool(self.commit)


def plan(paths: Iterable[str | Path], validate: Validate | None = None) -> tuple[DerivedFile, ...]:
    """Return the states of derived files, named by file or folder, after changes of their parents, parents first.

    Files in the same folder that derive from a file that would be re-pinned are included, because they become stale
    too. `validate` checks every derived file under the new parent.

    Raises:
        InputError: a path does not exist, a named file is not a clip or a mutant, or such a file has errors of its own.
    """
    with History() as history:
        return _Planner(_derived_files(paths), validate or (lambda _: ()), history).all()


def write(derived_files: Iterable[DerivedFile]) -> tuple[Path, ...]:
    """Write the new pins of stale derived files, one line of each file, and return the files."""
    written = []
    for derived in derived_files:
        if derived.state is PinState.STALE and derived.document is not None:
            write_whole(
                derived.file, with_pin(read_outside(derived.file).decode("utf-8"), derived.document, derived.new_pin)
            )
            written.append(derived.file)
    return tuple(written)


def with_pin(text: str, document: Document, pin: str) -> str:
    """Return a derived file's text (`document`: the parsed text) with another pin; the rest stays byte for byte, also
    its line ends."""
    model = document.model
    span = document.span(model, "pin")
    if not isinstance(model, m.Clip | m.Mutant) or span is None:
        raise TypeError("only clips and mutants have a pin")
    lines = re.split(r"(\r\n|\r|\n)", text)  # lines and line ends alternate
    at = 2 * (span.line - 1)
    line = lines[at]
    lines[at] = line[: span.column - 1] + line[span.column - 1 :].replace(model.pin, pin, 1)
    return "".join(lines)


def _derived_files(paths: Iterable[str | Path]) -> dict[Path, Path]:
    """Return the paths of the derived files as the user named them, keyed by their absolute paths."""
    named = tuple(map(Path, paths))
    derived_files: dict[Path, Path] = {}
    for file in scenario_files(named):
        kind = kind_of(file)
        if kind in ("clip", "mutant"):
            derived_files[absolute(file)] = file
        elif file in named and not is_folder(file):
            message = f"this holds {f'{with_article(kind)} without a pin' if kind else 'no definition'}"
            help = "name clips and mutants, or a folder of them"
            raise mistake("FS132", message, help, display_path(file))
    return derived_files


class _Planner:
    """Determines the states of derived files, each after its parent."""

    def __init__(self, files: dict[Path, Path], validate: Validate, history: History) -> None:
        self._files = files
        self._validate = validate
        self._history = history
        self._project = Project(check_pin=False)
        self._strict = Project()
        self._done: dict[Path, DerivedFile] = {}
        self._open: set[Path] = set()

    def all(self) -> tuple[DerivedFile, ...]:
        todo = list(self._files)
        while todo:
            path = todo.pop(0)
            derived = self._state_of(path)
            if derived.state is PinState.STALE:
                new = [beside for beside in _siblings(path) if beside not in self._files]
                self._files |= {beside: self._files[path].with_name(beside.name) for beside in new}
                todo += new
        return tuple(self._done.values())

    def _state_of(self, path: Path) -> DerivedFile:
        if path in self._done:
            return self._done[path]
        self._open.add(path)
        document = load(path, shown_as=display_path(self._files[path]))
        model = self._project.definition(self._files[path])
        if not (isinstance(model, m.Clip | m.Mutant) and isinstance(document.model, m.Clip | m.Mutant)):
            raise TypeError("only clips and mutants can be repinned, and this file is neither")
        parent = absolute(path.parent / model.parent)
        before = self._state_of(parent) if parent in self._files and parent not in self._open else None
        derived = self._judge(path, document, document.model, parent, before)
        self._open.discard(path)
        self._done[path] = replace(derived, document=document)
        return self._done[path]

    def _judge(
        self, path: Path, document: Document, model: m.Clip | m.Mutant, parent: Path, before: DerivedFile | None
    ) -> DerivedFile:
        case = model.case if isinstance(model, m.Clip) else None
        address = display_path(self._files[path].parent / model.parent) + (f"::{case}" if case else "")
        derived = DerivedFile(self._files[path], PinState.FRESH, address, model.pin)
        if before is not None and before.state in (PinState.CONFLICT, PinState.BLOCKED):
            return replace(
                derived, state=PinState.BLOCKED, mistakes=(_because(document, model, "cannot be re-pinned"),)
            )
        try:
            now = self._parent(address, before)
        except InputError as error:
            stale = any(diagnostic.code == "FS135" for diagnostic in error.diagnostics)
            state = PinState.BLOCKED if stale else PinState.CONFLICT
            why = (_because(document, model, "is stale itself"),) if stale else error.diagnostics
            return replace(derived, state=state, mistakes=why)
        derived = replace(derived, new_pin=pin_of(now))
        if derived.new_pin == model.pin:
            return derived
        derived = replace(derived, state=PinState.STALE)
        if before is not None and _pin_before(before) == derived.pin:
            return self._compared(replace(derived, follows=True), document, before.old, now)
        pinned = self._history.parent(parent, case, derived.pin)
        derived = replace(derived, commit=pinned.commit if pinned is not None else "")
        return self._compared(derived, document, pinned.case if pinned is not None else None, now)

    def _parent(self, address: str, before: DerivedFile | None) -> TestCase:
        """Return the parent as it will be after this call, with the pin that the call gives it."""
        if before is None:
            return self._strict.test_case(address)
        now = before.new if before.new is not None else self._strict.test_case(address)
        if now.clip is None or now.mutant is not None or before.state is not PinState.STALE:
            return now
        return replace(now, clip=now.clip.model_copy(update={"pin": before.new_pin}))

    def _compared(self, derived: DerivedFile, document: Document, was: TestCase | None, now: TestCase) -> DerivedFile:
        try:
            new = _expanded(document, derived.file, now)
            mistakes = tuple(diagnostic for diagnostic in self._validate(new) if diagnostic.severity == "error")
        except InputError as error:
            new, mistakes = None, error.diagnostics
        old = None  # the old parent is unknown, or the derived file did not fit it either
        if was is not None:
            with suppress(InputError):
                old = _expanded(document, derived.file, was)
        edit = diff_cases(was, now) if was is not None else ()
        reaching = diff_cases(old, new) if old is not None and new is not None else ()
        expected = {(change.path, change.was, change.now) for change in reaching}
        overridden = tuple(c for c in edit if (c.path, c.was, c.now) not in expected) if new is not None else edit
        derived = replace(derived, state=PinState.CONFLICT) if mistakes else derived
        return replace(derived, old=old, new=new, reaching=reaching, overridden=overridden, mistakes=mistakes)


def _expanded(document: Document, file: Path, parent: TestCase) -> TestCase:
    if isinstance(document.model, m.Clip):
        return expand_clip(document.model, parent, source=file, document=document)
    if isinstance(document.model, m.Mutant):
        return expand_mutant(document.model, parent, source=file, document=document)
    raise TypeError("only clips and mutants can be expanded")


def _pin_before(parent: DerivedFile) -> str:
    """Return the pin that files derived from this file had before this file was re-pinned; "" if unknown."""
    model = parent.document.model if parent.document is not None else None
    if isinstance(model, m.Clip):
        return clip_pin(model, model.pin)
    return pin_of(parent.old) if parent.old is not None else ""


def _siblings(path: Path) -> list[Path]:
    """Return the derived files in a file's folder that name it as their parent."""
    needle = f'"{path.name}"'.encode()
    siblings = []
    for file in sorted(path.parent.glob("*.foresee")):
        if file != path and kind_of(file) in ("clip", "mutant") and needle in read_outside(file):
            model = load(file).model
            if isinstance(model, m.Clip | m.Mutant) and absolute(file.parent / model.parent) == path:
                siblings.append(file)
    return siblings


def _because(document: Document, model: m.Clip | m.Mutant, why: str) -> Diagnostic:
    message = f"the parent '{model.parent}' {why}"
    return document.diagnostic(model, "parent", "FS135", message, "name it too, or correct it first")


def describe(derived: DerivedFile, verdict: tuple[str, str] | None = None, *, written: bool = False) -> str:
    """Return the report about one derived file; "" if its pin is up to date.

    `verdict` holds the verdicts of its runs under the old parent ("" if unknown) and under the new one.
    """
    if derived.state is PinState.FRESH:
        return ""
    lines = [_first_line(derived, written)]
    if derived.mistakes:
        lines.append(_indented(render_all(derived.mistakes)))
    if derived.state is not PinState.BLOCKED and not derived.follows:
        lines += _edit(derived)
    if verdict is not None:
        was, now = verdict
        same = f"the same, {now}" if was == now else f"{was} => {now}"
        lines.append(f"  run: {same}" if was else f"  run: {now} (the old run is unknown)")
    return "\n".join(lines) + "\n\n"


def summary(derived_files: Sequence[DerivedFile], *, written: bool = False) -> str:
    """Return the last line of the report: the number of derived files in each state."""
    count = {state: sum(derived.state is state for derived in derived_files) for state in PinState}
    done = "re-pinned" if written else "to re-pin (`--write` does it)"
    words = {
        PinState.FRESH: "up to date",
        PinState.STALE: done,
        PinState.CONFLICT: "in conflict",
        PinState.BLOCKED: "blocked",
    }
    return ", ".join(f"{count[state]} {text}" for state, text in words.items() if count[state]) or "no clips or mutants"


def _first_line(derived: DerivedFile, written: bool) -> str:
    if derived.state is PinState.CONFLICT:
        return f"{derived.file}: conflict with {derived.parent}, not re-pinned"
    if derived.state is PinState.BLOCKED:
        return f"{derived.file}: blocked, not re-pinned"
    why = f"follows {derived.parent}" if derived.follows else f"{derived.parent} changed"
    return f"{derived.file}: {why}\n  pin {derived.pin} => {derived.new_pin}{' (written)' if written else ''}"


def _edit(derived: DerivedFile) -> list[str]:
    if not derived.has_old_parent:
        unknown = "  the change is unknown: git has no version of the parent with this pin"
        return [unknown] if derived.new_pin else []
    lines = [f"  the pinned version of the parent is in commit {derived.commit}"]
    for title, changes in (
        ("reaches this file", derived.reaching),
        ("does not reach this file: it has its own statement, or does not use the changed one", derived.overridden),
    ):
        lines += [f"  {title}:\n{_indented(render_groups(changes).rstrip())}"] if changes else []
    if not derived.reaching and not derived.overridden:
        lines.append("  the edit changes nothing in this file")
    return lines


def _indented(text: str) -> str:
    return "\n".join(f"    {line}" if line else "" for line in text.split("\n"))
