"""Names of roads and junctions that a network does not have, for files that cannot be placed for other mistakes."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

from foresee_dsl.errors import Diagnostic, InputError
from foresee_dsl.language import model as m
from foresee_dsl.language.messages.findings import Findings
from foresee_dsl.language.messages.suggest import did_you_mean
from foresee_dsl.language.model.pattern import form_of
from foresee_dsl.language.project.document import Document
from foresee_dsl.language.traversal import walk

UNKNOWN_ROAD = "FS250"
UNKNOWN_JUNCTION = "FS251"


def unknown_names(document: Document, load: Callable[[Path], Document]) -> Iterator[Diagnostic]:
    """Yield the mistakes; none where the network is of another format, or cannot be read; `load` reads a file."""
    model = document.model
    network = _network(model, Path(document.path).parent, load) if isinstance(model, m.Scenario) else None
    if network is None or not isinstance(model, m.Scenario):
        return
    ramps = (m.OnRamp, m.OffRamp)
    crossed = (m.Junction, m.Roundabout, m.Zebra, m.Bump, *ramps)
    junctions = [item.name for item in network.body if isinstance(item, crossed)]
    roads = [item.name for item in network.body if isinstance(item, (m.Road, *ramps))]
    edges = {*roads, *(f"{road}_back" for road in roads)}
    parts = tuple(f"{item.name}_" for item in network.body if isinstance(item, crossed[1:]))  # `circle_west`
    findings = Findings(document)
    for statement in model.body:
        if isinstance(statement, m.Network | m.Param | m.Case):
            continue
        for item, field, kind, name in _named(statement):
            if kind == "junction" and name not in junctions and not name.startswith(parts):
                help = did_you_mean(name, junctions)
                findings.add(item, field, UNKNOWN_JUNCTION, f"there is no junction called {name}", help)
            elif kind == "road" and name.partition("#")[0] not in edges:
                help = did_you_mean(name, roads)
                findings.add(item, field, UNKNOWN_ROAD, f"there is no road or edge called {name}", help)
    yield from findings.sorted()


def _named(statement: m.Item) -> Iterator[tuple[m.Item, str, str, str]]:
    """Return the names of roads and junctions in a statement: item, field, which of both, name."""
    for item in walk(statement):
        for field in type(item).model_fields:
            names, value = form_of(type(item), field).names, getattr(item, field)
            if names is None or names.kind not in ("junction", "road") or names.defines:
                continue
            if isinstance(value, str):
                yield item, field, names.kind, value
            elif isinstance(value, tuple):
                yield from ((item, f"{field}.{k}", names.kind, v) for k, v in enumerate(value) if isinstance(v, str))


def _network(scenario: m.Scenario, folder: Path, load: Callable[[Path], Document]) -> m.Network | None:
    inline, used = scenario.one(m.Network), scenario.one(m.UseNetwork)
    if inline is not None or used is None or not used.path.endswith(".foresee") or not (folder / used.path).is_file():
        return inline
    try:
        model = load(folder / used.path).model
    except InputError:
        return None
    return model if isinstance(model, m.Network) else None
