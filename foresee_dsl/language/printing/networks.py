"""Networks and catalogues of models."""

from __future__ import annotations

from collections.abc import Sequence

from foresee_dsl.language import model as m
from foresee_dsl.language.printing import phrases as p
from foresee_dsl.language.printing.registry import MOST_INLINE, Layout, Parameters, block, body, line
from foresee_dsl.language.syntax.nodes import Key


@block(m.Junction)
def _junction(item: m.Junction, _: Parameters) -> Layout:
    said = item.control != "priority" or "control" in item.model_fields_set  # the default, where the author wrote it
    control = f" {item.control}" if said else ""
    inside: list[tuple[Key, m.Item | str]] = []
    if item.crossings is not None:
        inside.append((("crossings",), f"crossings {p.listing(item.crossings)}" if item.crossings else "crossings"))
    inside += body(item.stages, "stages")
    return Layout(f"junction {item.name} at {p.point(item.at)}{control}", inside or None, inline=not item.stages)


@line(m.Stage)
def _stage(item: m.Stage, _: Parameters) -> str:
    return f"stage {item.name} for {p.value(item.duration)} green {p.listing(item.green)}"


def _settings(item: m.Item, names: Sequence[str]) -> list[tuple[Key, m.Item | str]]:
    """The settings that are given, in the order of the names."""
    found = [(name, getattr(item, name)) for name in names]
    return [((name,), f"{name} {p.value(given)}") for name, given in found if given is not None]


@line(m.Building)
def _building(item: m.Building, _: Parameters) -> str:
    return f"building {item.name} {p.listing(p.point(at) for at in item.outline)}"


@block(m.Road)
def _road(item: m.Road, _: Parameters) -> Layout:
    inside = _settings(item, ("lanes", "back", "lane_width", "speed", "parking", "sidewalk", "median"))
    if item.via:
        inside.append((("via",), f"via {p.listing(p.point(at) for at in item.via)}"))
    inline = len(inside) <= MOST_INLINE and not item.via
    return Layout(f"road {item.name} from {item.start} to {item.end}", inside or None, inline=inline)


@block(m.VehicleModel)
def _vehicle_model(item: m.VehicleModel, _: Parameters) -> Layout:
    names = tuple(name for name in m.VehicleModel.model_fields if name not in ("kind", "name", "source"))
    inside = _settings(item, names)
    if item.source is not None:
        inside.append((("source",), f"source {p.string(item.source)}"))
    return Layout(f"model {item.name}", inside)
