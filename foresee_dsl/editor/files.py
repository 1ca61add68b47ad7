"""The files of a workspace: what the editor holds unsaved, what lies on the disk, and which file refers to which."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

from foresee_dsl.editor.symbols import Occurrence, occurrences
from foresee_dsl.editor.syntax import read_syntax, walk
from foresee_dsl.errors import ForeseeError
from foresee_dsl.files import data_folder, read_outside_text
from foresee_dsl.language import model as m
from foresee_dsl.language.model.item import SymbolKind
from foresee_dsl.language.parser import MAX_BYTES
from foresee_dsl.language.project.addresses import absolute, scenario_files
from foresee_dsl.language.syntax.node import Node

_EDGE = re.compile(r"(.*?)(_back)?(#[0-9]+)?$", re.DOTALL)
"""An edge's id: its road, `_back` for the other direction, `#1` for a part of one that netconvert cut."""
_BACKGROUND = re.compile(r"(.*)(_[0-9]+)$", re.DOTALL)
"""A background actor: `others_01` is of the traffic `others`."""


@dataclass(frozen=True)
class Found:
    """A definition in a file; `suffix` is what the use adds to the defined name (`_back`, `_01`)."""

    path: Path
    occurrence: Occurrence
    suffix: str = ""


class Files:
    """Texts by absolute path (`overlay`: those that an editor holds), and the way from a use to its definition; other
    files are looked for in `folders`."""

    def __init__(self, overlay: Mapping[Path, str], folders: Iterable[Path] = ()) -> None:
        self.overlay = overlay
        self._folders = tuple(folders)

    def text(self, path: Path) -> str | None:
        """Return a file's text, or None where it cannot be read as one."""
        held = self.overlay.get(path)
        return held if held is not None else _on_disk(path, _stamp(path))

    def names(self, path: Path) -> tuple[Occurrence, ...]:
        """Return the names in a file."""
        text = self.text(path)
        return occurrences(text) if text is not None and path.suffix == ".foresee" else ()

    def root(self, path: Path) -> Node | None:
        """Return what a file defines, as far as it can be read."""
        text = self.text(path)
        return read_syntax(text).root if text is not None and path.suffix == ".foresee" else None

    def all(self) -> tuple[Path, ...]:
        """Return every `.foresee` file of the workspace, and those that are open."""
        found = dict.fromkeys(path for path in self.overlay if path.suffix == ".foresee")
        for folder in self._folders:
            try:
                found |= dict.fromkeys(absolute(file) for file in scenario_files([folder]))
            except ForeseeError:
                continue  # the folder is gone
        return tuple(sorted(found))

    def used(self, path: Path) -> tuple[Path, ...]:
        """Return the files that a file names: its network, its models, its parent."""
        named = [o.name for o in self.names(path) if o.kind == "file"]
        return tuple(absolute(path.parent / name) for name in named)

    def scope(self, path: Path) -> tuple[Path, ...]:
        """Return a file and every file that it builds on, nearest first; the bundled models last."""
        found: dict[Path, None] = {path: None}
        waiting = [path]
        while waiting:
            for used in self.used(waiting.pop(0)):
                if used not in found:
                    found[used] = None
                    waiting.append(used)
        found.setdefault(absolute(data_folder("scenarios") / "models.foresee"))
        return tuple(found)

    def parents(self, path: Path) -> tuple[Path, ...]:
        """Return the files that a clip, mutant or extension comes from, nearest first."""
        found: list[Path] = []
        while (root := self.root(path)) is not None and isinstance(root.fields.get("parent"), str):
            path = absolute(path.parent / str(root.fields["parent"]))
            if path in found:
                break
            found.append(path)
        return tuple(found)

    def definitions(self, path: Path, *kinds: SymbolKind) -> dict[str, Found]:
        """Return what can be named in a file, by name, of some kinds; a nearer definition hides a farther one."""
        found: dict[str, Found] = {}
        for known in self._defined(path, *kinds):
            found.setdefault(known.occurrence.name, known)
        return found

    def _defined(self, path: Path, *kinds: SymbolKind) -> Iterator[Found]:
        for file in self.scope(path):
            yield from (Found(file, o) for o in self.names(file) if o.defines and o.kind in kinds)

    def define(self, path: Path, use: Occurrence) -> Found | None:
        """Return where a name that is used in a file is defined."""
        if use.kind == "file":
            return None
        if use.defines:
            return Found(path, use)
        kinds = self._kinds(path, use)
        if kinds == ("stage",):
            known = self.definitions(path, "parameter").get(use.name) if use.owner.kind is m.Ref else None
            junctions = self._junctions(path, use.scope) if use.kind == "word" else {use.scope} - {""}
            return known or self._stage(path, use.name, junctions)
        return self._of_kinds(path, use, kinds)

    def _of_kinds(self, path: Path, use: Occurrence, kinds: tuple[SymbolKind, ...]) -> Found | None:
        # A word where a parameter may stand is one if there is one of that name.
        for kind in ("parameter", *kinds) if use.owner.kind is m.Ref else kinds:
            there = self.definitions(path, kind)
            if use.name in there:
                return there[use.name]
            pattern = {"road": _EDGE, "actor": _BACKGROUND}.get(kind)
            base = pattern.fullmatch(use.name) if pattern is not None else None
            if (
                base is not None
                and base[1] in there
                and (kind == "road" or there[base[1]].occurrence.owner.kind is m.Traffic)
            ):
                found = there[base[1]]
                return Found(found.path, found.occurrence, use.name[len(base[1]) :])
        return None

    def _stage(self, path: Path, name: str, junctions: set[str]) -> Found | None:
        """Return a stage of one of some junctions; of any where none is known."""
        stages = (f for f in self._defined(path, "stage") if f.occurrence.name == name)
        return next((f for f in stages if not junctions or f.occurrence.scope in junctions), None)

    def _junctions(self, path: Path, parameter: str) -> set[str]:
        """Return the junctions of whose stages a parameter is one: those where it is used, in any file of the scope."""
        found: set[str] = set()
        for file in self.scope(path):
            root = self.root(file)
            for node, _ in walk(root) if root is not None else ():
                stage = node.fields.get("state" if node.kind is m.Shows else "stage")
                named = isinstance(stage, Node) and stage.kind is m.Ref and stage.fields.get("name") == parameter
                if (named or stage == parameter) and isinstance(junction := node.fields.get("junction"), str):
                    found.add(junction)
        return found

    def stages(self, path: Path, junction: object) -> tuple[str, ...]:
        """Return the names of a junction's stages."""
        found = (known.occurrence for known in self._defined(path, "stage"))
        return tuple(o.name for o in found if o.scope == junction)

    def type_of(self, path: Path, parameter: str) -> str:
        """Return the type of a parameter as written, or ""."""
        found = self.definitions(path, "parameter").get(parameter)
        return str(found.occurrence.owner.fields.get("type", "")) if found is not None else ""

    def _kinds(self, path: Path, use: Occurrence) -> tuple[SymbolKind, ...]:
        if use.kind == "thing":
            return "actor", "junction"
        if use.kind == "word":
            types: dict[str, tuple[SymbolKind, ...]] = {
                "arm": ("road", "junction"),
                "model": ("model",),
                "junction": ("junction",),
                "stage": ("stage",),
            }
            return types.get(self.type_of(path, use.scope), ())
        return (use.kind,)


def _stamp(path: Path) -> tuple[int, int] | None:
    try:
        status = path.stat()
    except (OSError, ValueError):
        return None
    return status.st_mtime_ns, status.st_size


@lru_cache(maxsize=1024)
def _on_disk(path: Path, stamp: tuple[int, int] | None) -> str | None:
    """Read a file once as long as it stays the same."""
    if stamp is None or stamp[1] > MAX_BYTES:
        return None
    try:
        return read_outside_text(path)
    except (OSError, UnicodeDecodeError):
        return None
