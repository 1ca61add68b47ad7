"""Catalogues of models: their entries, and checks that every named model exists and fits its actor."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from foresee_dsl.errors import with_article
from foresee_dsl.language import model as m
from foresee_dsl.language.document import Document
from foresee_dsl.language.messages.collector import Collector
from foresee_dsl.language.messages.suggest import did_you_mean
from foresee_dsl.language.model_classes import VEHICLE_CLASSES

CLASS_CRUISE_MPS = MappingProxyType({"pedestrian": 1.3, "bicycle": 15 / 3.6})
"""Cruise speed if neither the scenario nor the model gives one, m/s; other classes drive at the speed limit.
Pedestrian: ours, within the mean comfortable speeds of 1.27 to 1.46 m/s by age and sex in Bohannon (1997), Age and
Ageing 26(1). Bicycle: ours; in the German Naturalistic Cycling Study (Schleinitz et al. 2017, Safety Science 92)
conventional bicycles were 9 km/h slower than S-pedelecs, which averaged 24 km/h."""


def entries(catalogue: m.Catalogue) -> dict[str, m.VehicleModel]:
    """Return a catalogue's models by name."""
    return {item.name: item for item in catalogue.all(m.VehicleModel)}


def cruise_speed_mps(model: m.VehicleModel) -> float | None:
    """Return a model's cruise speed if the scenario gives none, m/s; None if it drives at the road's speed limit."""
    stated = model.cruise_speed
    own = stated.si if isinstance(stated, m.Quantity) else CLASS_CRUISE_MPS.get(model.name.partition(".")[0])
    top = model.max_speed
    return min(own, top.si) if own is not None and isinstance(top, m.Quantity) else own


def fits(model: str, kind: str) -> bool:
    """Return whether an actor of a kind (`ego`, `vehicle`, `pedestrian`, ...) may have a model."""
    class_ = model.partition(".")[0]
    return class_ in VEHICLE_CLASSES if kind in ("ego", "vehicle") else class_ == kind


def check_model(
    name: str,
    kind: str | None,
    models: Mapping[str, m.VehicleModel],
    collector: Collector,
    *,
    place: tuple[m.Item | None, str],
) -> None:
    """Report a model that does not exist, or whose class does not fit its actor (kind None: any class fits).

    `place` is the item and its field in which the name is written: an actor, a case, or a change line.
    """
    item, field = place
    if name not in models:
        collector.add(item, field, "FS110", f"there is no model '{name}'", did_you_mean(name, models))
    elif kind is not None and not fits(name, kind):
        wanted = ", ".join(VEHICLE_CLASSES) if kind in ("ego", "vehicle") else kind
        message = f"{'the ego' if kind == 'ego' else with_article(kind)} cannot have the model '{name}'"
        near = [model for model in models if fits(model, kind)]
        collector.add(item, field, "FS038", message, f"it needs a model of class {wanted}: {', '.join(near[:5])}")


def check_models(
    scenario: m.Scenario, models: Mapping[str, m.VehicleModel], document: Document | None, case: str | None
) -> None:
    """Check all models that a concrete scenario names; `case`: the case with the parameters' values."""
    collector = Collector(document)
    body = document.model.body if document is not None and isinstance(document.model, m.Scenario | m.Clip) else ()
    written = {item.name: item for item in body if isinstance(item, m.Ego | m.Actor)}
    for actor in scenario.actors:
        if isinstance(actor.model, str):
            place = _place(written.get(actor.name), document, case)
            check_model(actor.model, actor.kind, models, collector, place=place)
    for traffic in scenario.all(m.Traffic):
        for position, name in enumerate(traffic.models):
            check_model(name, None, models, collector, place=(traffic, f"models.{position}"))
    collector.raise_if_any()


def _place(actor: m.Ego | m.Actor | None, document: Document | None, case: str | None) -> tuple[m.Item | None, str]:
    """Return the item that names an actor's model: the actor, or the case or parameter that it refers to."""
    scenario = document.model if document is not None else None
    if actor is None or not isinstance(actor.model, m.Ref) or not isinstance(scenario, m.Scenario):
        return actor, "model"  # only scenarios have parameters
    assignments = [value for item in scenario.all(m.Case) if item.name == case for value in item.values]
    places: list[tuple[m.Item, str]] = [(value, "value") for value in assignments if value.name == actor.model.name]
    places += [(param, "default") for param in scenario.all(m.Param) if param.name == actor.model.name]
    return (*places, (actor, "model"))[0]
