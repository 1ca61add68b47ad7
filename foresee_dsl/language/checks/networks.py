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
    for field, name, other in (("start", road.start, road.end), ("end", road.end, road.start)):
        if name not in junctions:
            help = did_you_mean(name, [known for known in junctions if known != other])
            findings.add(road, field, "FS040", f"unknown junction '{name}'", help)
    others = [name for name in dict.fromkeys(junctions) if name != road.start]
    if road.start == road.end:
        help = f"known are {', '.join(others)}" if others else "add `junction b at (100 m, 0 m)`"
        findings.add(road, "end", "FS050", "this road ends where it begins", f"a road joins two junctions; {help}")
    if road.name.removesuffix("_back") in roads - {road.name}:
        other = road.name.removesuffix("_back")
        message = f"'{road.name}' is also the other direction of road '{other}'"
        findings.add(road, "name", "FS030", message, "give it another name")


def _check_junction(findings: Findings, junction: m.Junction, network: m.Network) -> None:
    findings.unique(((s, "name", s.name) for s in junction.stages), f"stages of '{junction.name}'")
    if junction.control == "signals" and not junction.stages:
        roads = dict.fromkeys(
            item.name for item in network.body if isinstance(item, m.Road) and junction.name in (item.start, item.end)
        )
        help = f"add at least one: `stage go for 25 s green [{', '.join(roads) or 'north, south'}]`"
        findings.add(junction, "name", "FS048", f"the signals of '{junction.name}' have no stages", help)
    if junction.control != "signals" and junction.stages:
        help = f"write `signals` after the position of '{junction.name}', or remove it"
        findings.add(junction.stages[0], "", "FS048", "a stage at a junction without signals", help)
    named: list[tuple[m.Item, str, str]]
    named = [(junction, f"crossings.{k}", name) for k, name in enumerate(junction.crossings or ())]
    named += [(stage, f"green.{k}", name) for stage in junction.stages for k, name in enumerate(stage.green)]
    check_touching(findings, junction.name, named, network)
