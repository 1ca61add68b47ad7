"""Checks of a written network: names, what touches what, and that everything on a road has its place there."""

from __future__ import annotations

from collections.abc import Sequence

from foresee_dsl.language import model as m
from foresee_dsl.language.checks.streets import NamedJunction, Ramp, Streets, check_touching
from foresee_dsl.language.messages.findings import Findings
from foresee_dsl.language.messages.suggest import did_you_mean


def check_network(findings: Findings, network: m.Network) -> None:
    """Check a network, in a file of its own or inside a scenario."""
    junctions = [item for item in network.body if isinstance(item, m.Junction)]
    roads = [item for item in network.body if isinstance(item, m.Road)]
    named = (item for item in network.body if isinstance(item, NamedJunction))
    findings.unique(((j, "name", j.name) for j in named), "junctions")
    findings.unique(((r, "name", r.name) for r in network.body if isinstance(r, m.Road | Ramp)), "roads")
    buildings = (item for item in network.body if isinstance(item, m.Building))
    findings.unique(((b, "name", b.name) for b in buildings), "buildings")
    names = [item.name for item in network.body if isinstance(item, m.Junction | m.Roundabout)]
    for road in roads:
        _check_road(findings, road, names, {r.name for r in roads})
    for junction in junctions:
        _check_junction(findings, junction, network)
    if not roads:
        findings.add(network, "name", "FS014", "this network has no roads", "add `road main from a to b`")
    if len(junctions) + len(roads) + sum(isinstance(b, m.Building | m.Doc) for b in network.body) < len(network.body):
        Streets(findings, network, names).check()


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


def _check_junction(findings: Findings, junction: m.Junction, network: m.Network) -> None:
    findings.unique(((s, "name", s.name) for s in junction.stages), f"stages of '{junction.name}'")
    if junction.control == "signals" and not junction.stages:
        help = "add at least one: `stage ns_go for 25 s green [north, south]`"
        findings.add(junction, "name", "FS048", f"the signals of '{junction.name}' have no stages", help)
    if junction.control != "signals" and junction.stages:
        help = f"write `signals` after its position, or remove the stages of '{junction.name}'"
        findings.add(junction.stages[0], "", "FS048", "a stage at a junction without signals", help)
    named: list[tuple[m.Item, str, str]]
    named = [(junction, f"crossings.{k}", name) for k, name in enumerate(junction.crossings or ())]
    named += [(stage, f"green.{k}", name) for stage in junction.stages for k, name in enumerate(stage.green)]
    check_touching(findings, junction.name, named, network)
