"""The files of a workspace: unsaved texts of the editor, texts on the disk, and references between files."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

from foresee_dsl.editor.symbols import Occurrence, occurrences
from foresee_dsl.editor.syntax import read_syntax, walk
from foresee_dsl.errors import ForeseeError
from foresee_dsl.files import absolute, data_folder, read_outside_text, stamp_of
from foresee_dsl.language import model as m
from foresee_dsl.language.model.item import SymbolKind
from foresee_dsl.language.parser import MAX_BYTES
from foresee_dsl.language.project.addresses import kind_of, kind_of_text, marked, project_folder, scenario_files
from foresee_dsl.language.syntax.node import Node

_EDGE = re.compile(r"(.*?)(_back)?(#[0-9]+)?$", re.DOTALL)
"""An edge's id: its road, `_back` for the other direction, `#1` for a part of a road that netconvert split."""
_BACKGROUND = re.compile(r"(.*)(_[0-9]+)$", re.DOTALL)
"""A background actor's name: `others_01` belongs to the traffic `others`."""


@dataclass(frozen=True)
class Definition:
    """A definition in a file. `suffix` is the part that a use adds to the defined name (`_back`, `_01`)."""

    path: Path
    occurrence: Occurrence
    suffix: str = ""


class Files:
    """Reads files and finds definitions of names.

    `overlay` holds texts of the editor by absolute path, `folders` the folders in which other files are searched.
    """

    def __init__(self, overlay: Mapping[Path, str], folders: Iterable[Path] = ()) -> None:
        self.overlay = overlay
        self._folders = tuple(folders)

    def text(self, path: Path) -> str | None:
        """Return a file's text, or None if it cannot be read as text."""
        held = self.overlay.get(path)
        return held if held is not None else _on_disk(path, stamp_of(path))

    def names(self, path: Path) -> tuple[Occurrence, ...]:
        """Return the names in a file."""
        text = self.text(path)
        return occurrences(text) if text is not None and path.suffix == ".foresee" else ()

    def root(self, path: Path) -> Node | None:
        """Return the node of a file's definition, as far as it can be read."""
        text = self.text(path)
        return read_syntax(text).root if text is not None and path.suffix == ".foresee" else None

    def kind(self, path: Path) -> str:
        """Return the kind of a file by its first keyword; "" if unclear."""
        held = self.overlay.get(path)
        return kind_of_text(held) if held is not None else kind_of(path)

    def project(self, path: Path) -> Path:
        """Return the folder of the project that a file belongs to; without a mark of one, the folder that is open."""
        project = project_folder(path.parent)
        if marked(project):
            return project
        return next((folder for folder in self._folders if path.is_relative_to(folder)), path.parent)

    def all(self) -> tuple[Path, ...]:
        """Return all `.foresee` files of the workspace, and the open ones."""
        files = dict.fromkeys(path for path in self.overlay if path.suffix == ".foresee")
        for folder in self._folders:
            try:
                files |= dict.fromkeys(absolute(file) for file in scenario_files([folder]))
            except ForeseeError:
                continue  # the folder no longer exists
        return tuple(sorted(files))

    def used(self, path: Path) -> tuple[Path, ...]:
        """Return the files that a file names, such as its network, its models and its parent."""
        named = [o.name for o in self.names(path) if o.kind == "file"]
        return tuple(absolute(path.parent / name) for name in named)

    def scope(self, path: Path) -> tuple[Path, ...]:
        """Return a file and all files on which it builds, nearest first, with the bundled models last."""
        in_scope: dict[Path, None] = {path: None}
        waiting = [path]
        while waiting:
            for used in self.used(waiting.pop(0)):
                if used not in in_scope:
                    in_scope[used] = None
                    waiting.append(used)
        in_scope.setdefault(absolute(data_folder("scenarios") / "models.foresee"))
        return tuple(in_scope)

    def definitions(self, path: Path, *kinds: SymbolKind) -> dict[str, Definition]:
        """Return the definitions of some kinds that a file can use, by name; a nearer definition hides a farther
        one."""
        definitions: dict[str, Definition] = {}
        for definition in self._defined(path, *kinds):
            definitions.setdefault(definition.occurrence.name, definition)
        return definitions

    def _defined(self, path: Path, *kinds: SymbolKind) -> Iterator[Definition]:
        for file in self.scope(path):
            yield from (Definition(file, o) for o in self.names(file) if o.defines and o.kind in kinds)

    def define(self, path: Path, use: Occurrence) -> Definition | None:
        """Return the definition of a name that is used in a file; None if there is none."""
        if use.kind == "file":
            return None
        if use.defines:
            return Definition(path, use)
        kinds = self._kinds(path, use)
        if kinds == ("stage",):
            definition = self.definitions(path, "parameter").get(use.name) if use.owner.kind is m.Ref else None
            junctions = self._junctions(path, use.scope) if use.kind == "word" else {use.scope} - {""}
            return definition or self._stage(path, use.name, junctions)
        return self._of_kinds(path, use, kinds)

    def _of_kinds(self, path: Path, use: Occurrence, kinds: tuple[SymbolKind, ...]) -> Definition | None:
        # Where a parameter may stand, a word is a parameter if one of that name exists.
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
                base_definition = there[base[1]]
                return Definition(base_definition.path, base_definition.occurrence, use.name[len(base[1]) :])
        return None

    def _stage(self, path: Path, name: str, junctions: set[str]) -> Definition | None:
        """Return a stage of this name at one of these junctions; at any junction if the set is empty."""
        stages = (f for f in self._defined(path, "stage") if f.occurrence.name == name)
        return next((f for f in stages if not junctions or f.occurrence.scope in junctions), None)

    def _junctions(self, path: Path, parameter: str) -> set[str]:
        """Return the junctions for which a parameter is used as a stage, in any file of the scope."""
        junctions: set[str] = set()
        for file in self.scope(path):
            root = self.root(file)
            for node, _ in walk(root) if root is not None else ():
                stage = node.fields.get("state" if node.kind is m.Shows else "stage")
                named = isinstance(stage, Node) and stage.kind is m.Ref and stage.fields.get("name") == parameter
                if (named or stage == parameter) and isinstance(junction := node.fields.get("junction"), str):
                    junctions.add(junction)
        return junctions

    def stages(self, path: Path, junction: object) -> tuple[str, ...]:
        """Return the names of a junction's stages."""
        stages = (definition.occurrence for definition in self._defined(path, "stage"))
        return tuple(o.name for o in stages if o.scope == junction)

    def type_of(self, path: Path, parameter: str) -> str:
        """Return the type of a parameter as written; "" if it is not defined."""
        definition = self.definitions(path, "parameter").get(parameter)
        return str(definition.occurrence.owner.fields.get("type", "")) if definition is not None else ""

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


@lru_cache(maxsize=1024)
def _on_disk(path: Path, stamp: tuple[int, int] | None) -> str | None:
    """Return a file's text; read again only when `stamp` changes."""
    if stamp is None or stamp[1] > MAX_BYTES:
        return None
    try:
        return read_outside_text(path)
    except (OSError, UnicodeDecodeError):
        return None
