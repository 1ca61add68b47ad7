"""Where the actors, triggers, junctions and roads of a test case are written, across the files that it is made of."""

from __future__ import annotations

from pathlib import Path

from foresee_dsl.errors import InputError
from foresee_dsl.language import model as m
from foresee_dsl.language.project.addresses import absolute
from foresee_dsl.language.project.document import Document, TestCase
from foresee_dsl.language.project.loading import Project
from foresee_dsl.report.picture.subject import TextPlace


class TextPlaces:
    """Finds them; files are read by way of the project that loaded the test case, so each once."""

    def __init__(self, project: Project, case: TestCase) -> None:
        self._documents = _chain(project, case)
        self._network = _network(project, case)

    def actor(self, name: str) -> TextPlace | None:
        """Return where an actor is written; of a mutant, first its `change`."""
        for document in self._documents:
            for item in document.model.body:
                named = isinstance(item, m.Ego | m.Actor) and item.name == name
                drawn = isinstance(item, m.Traffic) and name.rpartition("_")[0] == item.name
                if named or drawn or (isinstance(item, m.Change) and item.actor == name):
                    return place_of(document, item)
        return None

    def trigger(self, kind: type[m.When | m.Expect], number: int) -> TextPlace | None:
        """Return where the trigger (or expectation) of that number is written; None where the files have others."""
        for document in self._documents:
            found = [item for item in document.model.body if isinstance(item, kind)]
            if number < len(found):
                return place_of(document, found[number])
        return None

    def patch(self, name: str) -> TextPlace | None:
        """Return where a slippery patch is written."""
        for document in self._documents:
            for item in document.model.body:
                if isinstance(item, m.Slippery) and item.name == name:
                    return place_of(document, item)
        return None

    def network_item(self, name: str) -> TextPlace | None:
        """Return where a junction or a road is written."""
        if self._network is None:
            return None
        document, network = self._network
        items = (item for item in network.body if isinstance(item, m.Junction | m.Road))
        found = next((item for item in items if item.name == name), None)
        return place_of(document, found) if found is not None else None

    @property
    def files(self) -> tuple[Path, ...]:
        """Every file that was looked at."""
        found: dict[Path, None] = {}
        for document in (*self._documents, *((self._network[0],) if self._network is not None else ())):
            one: Document | None = document
            while one is not None:
                found[absolute(Path(one.path))] = None
                one = one.base
        return tuple(found)


def place_of(document: Document, item: m.Item) -> TextPlace | None:
    """Return where an item of a document is written: there, or in the one that it extends."""
    one = document
    while (span := one.spans.get((id(item), ""))) is None:
        if one.base is None:
            return None
        one = one.base
    return TextPlace(absolute(Path(one.path)), span.line, span.column, span.end_line)


def _chain(project: Project, case: TestCase) -> tuple[Document, ...]:
    """Return the documents of a test case, nearest first: a mutant's, its clip's."""
    if case.document is None:
        return ()
    found = [case.document]
    while isinstance(model := found[-1].model, m.Mutant):
        try:
            found.append(project.document(Path(found[-1].path).parent / model.parent))
        except InputError:
            break
    return tuple(found)


def _network(project: Project, case: TestCase) -> tuple[Document, m.Network] | None:
    used, inline = case.scenario.one(m.UseNetwork), case.scenario.one(m.Network)
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
