"""Networks and catalogues: names, roads that end somewhere, stages of roads that touch their junction."""

from __future__ import annotations

from collections.abc import Sequence

from foresee_dsl.language import model as m
from foresee_dsl.language.messages.findings import Findings
from foresee_dsl.language.messages.suggest import did_you_mean
from foresee_dsl.language.printer import written
from foresee_dsl.language.project.catalogues import CLASSES, SUM_SLACK_M


def check_network(findings: Findings, network: m.Network) -> None:
    """Check a network, in a file of its own or inside a scenario."""
    junctions = [item for item in network.body if isinstance(item, m.Junction)]
    roads = [item for item in network.body if isinstance(item, m.Road)]
    findings.unique(((j, "name", j.name) for j in junctions), "junctions")
    findings.unique(((r, "name", r.name) for r in roads), "roads")
    buildings = (item for item in network.body if isinstance(item, m.Building))
    findings.unique(((b, "name", b.name) for b in buildings), "buildings")
    names = [junction.name for junction in junctions]
    for road in roads:
        _check_road(findings, road, names, {r.name for r in roads})
    for junction in junctions:
        _check_junction(findings, junction, roads)
    if not roads:
        findings.add(network, "name", "FS014", "this network has no roads", "add `road main from a to b`")


def check_catalogue(findings: Findings, catalogue: m.Catalogue) -> None:
    """Check a catalogue of models."""
    models = [item for item in catalogue.body if isinstance(item, m.VehicleModel)]
    findings.unique(((model, "name", model.name) for model in models), "models")
    for model in models:
        class_ = model.name.partition(".")[0]
        if class_ not in CLASSES:
            help = did_you_mean(class_, CLASSES)
            findings.add(model, "name", "FS012", f"unknown class of models '{class_}'", help)
        _check_figures(findings, model)


def _check_figures(findings: Findings, model: m.VehicleModel) -> None:
    """Report figures of a model that contradict each other."""
    for less, more in (("cruise_speed", "max_speed"), ("braking", "emergency_braking")):
        low, high = getattr(model, less), getattr(model, more)
        if isinstance(low, m.Quantity) and isinstance(high, m.Quantity) and low.si > high.si:
            message = f"its {less} `{written(low)}` is above its {more} `{written(high)}`"
            findings.add(model, less, "FS055", message, f"use at most `{written(high)}`, or raise `{more}`")
    parts = {name: getattr(model, name) for name in ("front_overhang", "wheelbase", "rear_overhang")}
    given = {name: part for name, part in parts.items() if isinstance(part, m.Quantity)}
    if not given or not isinstance(model.length, m.Quantity):
        return
    sum_m, length_m = sum(part.si for part in given.values()), model.length.si
    over_m = sum_m - length_m
    if over_m > SUM_SLACK_M or (len(given) == len(parts) and over_m < -SUM_SLACK_M):
        message = f"{' + '.join(given)} is {sum_m:.2f} m, and the length is {length_m:.2f} m"
        last = next(reversed(given))
        left_m = length_m - (sum_m - given[last].si)
        help = f"write `{last} {left_m:.2f} m`" if left_m > 0 else "correct them, or the length"
        findings.add(model, last, "FS055", message, help)


def _check_road(findings: Findings, road: m.Road, junctions: Sequence[str], roads: set[str]) -> None:
    for field, name in (("start", road.start), ("end", road.end)):
        if name not in junctions:
            findings.add(road, field, "FS040", f"unknown junction '{name}'", did_you_mean(name, junctions))
    if road.start == road.end:
        findings.add(road, "end", "FS050", "this road ends where it begins", "a road joins two junctions")
    if road.name.removesuffix("_back") in roads - {road.name}:
        other = road.name.removesuffix("_back")
        message = f"'{road.name}' is also the other direction of road '{other}'"
        findings.add(road, "name", "FS030", message, "give it another name")


def _check_junction(findings: Findings, junction: m.Junction, roads: Sequence[m.Road]) -> None:
    findings.unique(((s, "name", s.name) for s in junction.stages), f"stages of '{junction.name}'")
    if junction.control == "signals" and not junction.stages:
        help = "add at least one: `stage ns_go for 25 s green [north, south]`"
        findings.add(junction, "name", "FS048", f"the signals of '{junction.name}' have no stages", help)
    if junction.control != "signals" and junction.stages:
        help = f"write `signals` after its position, or remove the stages of '{junction.name}'"
        findings.add(junction.stages[0], "", "FS048", "a stage at a junction without signals", help)
    touching = [road.name for road in roads if junction.name in (road.start, road.end)]
    named: list[tuple[m.Item, str, str]]
    named = [(junction, f"crossings.{k}", name) for k, name in enumerate(junction.crossings or ())]
    named += [(stage, f"green.{k}", name) for stage in junction.stages for k, name in enumerate(stage.green)]
    for item, field, name in named:
        if name in touching:
            continue
        known = name in {road.name for road in roads}
        message = f"road '{name}' does not touch '{junction.name}'" if known else f"unknown road '{name}'"
        findings.add(item, field, "FS041", message, did_you_mean(name, touching))
