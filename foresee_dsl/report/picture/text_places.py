"""Finds the places of a test case's actors, triggers, junctions and roads in all files on which it is built."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from foresee_dsl.errors import InputError
from foresee_dsl.files import absolute
from foresee_dsl.language import model as m
from foresee_dsl.language.document import Document, TestCase
from foresee_dsl.language.project.loading import Project
from foresee_dsl.report.drawing.sheet import TextPlace


class TextPlaces:
    """Finds the places of items in files.

    It uses the project that loaded the test case, so that each file is read once.
    """

    def __init__(self, project: Project, case: TestCase) -> None:
        self._documents = _chain(project, case)
        self._network = _network(project, case)

    def actor(self, name: str) -> TextPlace | None:
        """Return the place of an actor; in a mutant, the place of the actor's first `change`, if there is one."""

        def is_about(item: m.Item) -> bool:
            named = isinstance(item, m.Ego | m.Actor) and item.name == name
            drawn = isinstance(item, m.Traffic) and name.rpartition("_")[0] == item.name
            return named or drawn or (isinstance(item, m.Change) and item.actor == name)

        return self._first(is_about)

    def trigger(self, kind: type[m.When | m.Expect], number: int) -> TextPlace | None:
        """Return the place of a trigger or expectation by its index; None if the files have fewer."""
        for document in self._documents:
            items = [item for item in document.model.body if isinstance(item, kind)]
            if number < len(items):
                return place_of(document, items[number])
        return None

    def patch(self, name: str) -> TextPlace | None:
        """Return the place of a slippery patch."""
        return self._first(lambda item: isinstance(item, m.Slippery) and item.name == name)

    def _first(self, chosen: Callable[[m.Item], bool]) -> TextPlace | None:
        """Return the place of the first item that is chosen."""
        items = ((document, item) for document in self._documents for item in document.model.body if chosen(item))
        return next((place_of(document, item) for document, item in items), None)

    def network_item(self, name: str) -> TextPlace | None:
        """Return the place of a junction or a road."""
        if self._network is None:
            return None
        document, network = self._network
        items = (item for item in network.body if isinstance(item, m.Junction | m.Road))
        named = next((item for item in items if item.name == name), None)
        return place_of(document, named) if named is not None else None

    @property
    def files(self) -> tuple[Path, ...]:
        """Return all files that were read."""
        files: dict[Path, None] = {}
        for document in (*self._documents, *((self._network[0],) if self._network is not None else ())):
            source: Document | None = document
            while source is not None:
                files[absolute(Path(source.path))] = None
                source = source.base
        return tuple(files)


def place_of(document: Document, item: m.Item) -> TextPlace | None:
    """Return the place of an item of a document, which is in the document itself or in one that it extends."""
    source = document
    while (span := source.spans.get((id(item), ""))) is None:
        if source.base is None:
            return None
        source = source.base
    return TextPlace(absolute(Path(source.path)), span.line, span.column, span.end_line)


def _chain(project: Project, case: TestCase) -> tuple[Document, ...]:
    """Return the documents of a test case; the document of a mutant comes before the document of its clip."""
    if case.document is None:
        return ()
    documents = [case.document]
    while isinstance(model := documents[-1].model, m.Mutant):
        try:
            documents.append(project.document(Path(documents[-1].path).parent / model.parent))
        except InputError:
            break
    return tuple(documents)


def _network(project: Project, case: TestCase) -> tuple[Document, m.Network] | None:
    used, inline = case.scenario.first(m.UseNetwork), case.scenario.first(m.Network)
    if case.document is not None and inline is not None:
        written = next((item for item in case.document.model.body if isinstance(item, m.Network)), None)
        return (case.document, written) if written is not None else None
    if used is None or not used.path.endswith(".foresee"):
        return None
    try:
        document = project.document(case.source.parent / used.path)
    except InputError:
        return None
    return (document, document.model) if isinstance(document.model, m.Network) else None
