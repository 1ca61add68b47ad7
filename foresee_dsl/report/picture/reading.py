"""Finds the scene that an address names: a test case, placed as far as possible, or a network alone."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from itertools import pairwise
from pathlib import Path

import numpy as np

from foresee_dsl.compile.bundle import PlacedActor, Signal
from foresee_dsl.compile.compiler import Sketch, network_of, sketch_case
from foresee_dsl.compile.placement.checks import footprint
from foresee_dsl.compile.roads.network import RoadNetwork
from foresee_dsl.compile.roads.polyline import distance
from foresee_dsl.drivers.protocol import SignalColour
from foresee_dsl.errors import InputError
from foresee_dsl.files import absolute
from foresee_dsl.helps import Help
from foresee_dsl.kernels.arrays import FloatArray
from foresee_dsl.language import model as m
from foresee_dsl.language.document import Document, TestCase
from foresee_dsl.language.printer import print_item
from foresee_dsl.language.project import addresses as a
from foresee_dsl.language.project.loading import Project
from foresee_dsl.language.traversal import all_actions, si_of, word_of
from foresee_dsl.report.drawing.ground import stop_line
from foresee_dsl.report.drawing.sheet import TextPlace
from foresee_dsl.report.picture.subject import (
    TONES,
    Body,
    Mistake,
    Name,
    Patch,
    SceneSubject,
    ShownWay,
    SignalLine,
    Tone,
)
from foresee_dsl.report.picture.text_places import TextPlaces, place_of
from foresee_dsl.report.picture.zones import where_is, zones_of
from foresee_dsl.simulate.signals import colour_shown

ALONE_M = 60.0
"""Length of a route that should be visible from its start if it does not meet another route, m. Ours: 4 s at 50
km/h."""
MEET_M = 12.0
"""Two routes meet where they are less than half of this apart, m. Ours: the width of a junction of two lanes."""
BEYOND_M = 15.0
"""A route should be visible up to this far behind the place where it meets another, m. Ours: three car lengths."""
_ROUND = 48
"""Number of corners of the outline of a slippery patch. Ours: at a radius of 5 m the outline is within 1 cm of the
circle."""
_STEP_M = 2.0
"""Distance between the drawn points of a route, m. Ours: in a bend of 10 m radius the line is 5 cm off."""
_PART = re.compile(r"(_back)?(#[0-9]+)?$")
"""Suffixes that netconvert and the language append to the name of a road."""
_BEST_FIRST: tuple[SignalColour, ...] = ("green", "amber", "red", "off")
"""The colours of a signal in the order in which they are chosen for a lane with several movements."""


def read_subject(
    address: str, overlay: Mapping[Path, str] | None = None, *, allow_outside: bool = True
) -> SceneSubject:
    """Return the scene that an address names; if it names a scenario with cases, but none of the cases, the scene of
    the first case.

    `overlay`: texts of an editor that replace those on the disk, by absolute path.

    Raises:
        InputError: an error in a text, with its place. CompileError: the network cannot be built.
    """
    project = Project(allow_outside=allow_outside, overlay=overlay)
    file, case = a.parse_address(address)
    if file.name.endswith(a.FOREIGN_NETWORKS) and case is None:
        if not a.is_file(file):
            raise a.missing(file)
        return _network_alone(file.name, "", absolute(file), None)
    document = project.document(file)
    if isinstance(document.model, m.Network):
        about = next((item.text for item in document.model.body if isinstance(item, m.Doc)), "")
        return _network_alone(a.display_path(file), about, document.model, document)
    names: tuple[str, ...] = ()
    if isinstance(document.model, m.Scenario | m.Extension):
        names = _cases(project.whole_scenario(file))
        case = case or (names[0] if names else None)
    elif isinstance(document.model, m.Catalogue | m.Campaign):
        message = f"there is no picture of a file with {document.model.kind}"
        raise InputError((document.diagnostic(document.model, "", "FS001", message, "name a scenario or a network"),))
    loaded = project.test_case(f"{file}::{case}" if case else file)
    return subject_of(loaded, project, names, case or "")


def subject_of(case: TestCase, project: Project, names: tuple[str, ...] = (), chosen: str = "") -> SceneSubject:
    """Return the scene of a test case's picture; actors that cannot be placed are left out and reported as errors."""
    sketch = sketch_case(case)
    texts = TextPlaces(project, case)
    bodies = _bodies(case, sketch, texts, project)
    tones = {body.name: body.tone for body in bodies}
    ways = (*_ways(sketch, texts, tones), *_later_ways(case, sketch, texts, tones))
    stages = {word_of(s.junction): (word_of(s.stage), si_of(s.elapsed)) for s in case.scenario.all(m.SignalState)}
    passed = {p.junction for actor in sketch.actors if actor.line is not None for p in actor.line.passages}
    driven = {edge for actor in sketch.actors for edge in actor.route}
    changes = tuple(print_item(change) for change in case.mutant.changes) if case.mutant is not None else ()
    document = case.document
    about = next((item.text for item in document.model.body if isinstance(item, m.Doc)), "") if document else ""
    return SceneSubject(
        title=case.id,
        about=about,
        network=sketch.network,
        bodies=bodies,
        ways=ways,
        zones=zones_of(case, sketch, texts),
        patches=tuple(_patches(sketch, texts)),
        heads=tuple(_heads(sketch.network, sketch.signals, stages)),
        names=(
            *_stops(case.network, sketch.network),
            *_names(sketch.network, sketch.signals, stages, passed | driven, texts),
        ),
        mistakes=tuple(_mistakes(sketch, bodies)),
        changes=changes,
        cases=names,
        case=chosen,
        files=texts.files,
    )


def _network_alone(name: str, about: str, model: m.Network | Path, document: Document | None) -> SceneSubject:
    network, signals = network_of(model, document)
    places: dict[str, TextPlace | None] = {}
    if document is not None and isinstance(model, m.Network):
        items = (item for item in model.body if isinstance(item, m.Junction | m.Road))
        places = {item.name: place_of(document, item) for item in items}
    files = (model,) if isinstance(model, Path) else (absolute(Path(document.path)),) if document is not None else ()
    return SceneSubject(
        title=name,
        about=about,
        network=network,
        heads=tuple(_heads(network, signals, {})),
        names=(*_stops(model, network), *_names(network, signals, {}, frozenset(), places)),
        files=files,
    )


def _cases(scenario: m.Scenario) -> tuple[str, ...]:
    return tuple(case.name for case in scenario.all(m.Case))


def _patches(sketch: Sketch, texts: TextPlaces) -> Iterator[Patch]:
    for patch in sketch.slippery:
        turns = np.linspace(0.0, 2 * np.pi, _ROUND, endpoint=False)
        outline = np.column_stack([np.cos(turns), np.sin(turns)]) * patch.radius_m + (patch.x, patch.y)
        yield Patch(patch.name, outline, patch.friction, texts.patch(patch.name))


# ---- actors ---------------------------------------------------------------------------------------------------------


def _bodies(case: TestCase, sketch: Sketch, texts: TextPlaces, project: Project) -> tuple[Body, ...]:
    wrong: dict[str, str] = {}
    for problem in sketch.problems:
        wrong.setdefault(problem.actor, problem.text)
    background = _background(case, project)
    named = {actor.name for actor in case.scenario.actors if actor.name not in background}
    before = _before(case, project)
    bodies = []
    tones = 0
    for actor in sketch.actors:
        tone: Tone = "traffic"
        if actor.id == "ego":
            tone = "ego"
        elif actor.control == "static" and actor.id in named:
            tone = "thing"
        elif actor.id in named:
            tone, tones = TONES[tones % len(TONES)], tones + 1
        corners = np.array(footprint(actor))
        old = before.get(actor.id)
        moved = old is not None and float(np.abs(old - corners).max()) > 0.05
        bodies.append(
            Body(
                name=actor.id,
                about=f"{actor.model.name}, {_speed(actor)}",
                kind=actor.model.kind,
                tone=tone,
                corners=corners,
                text=texts.actor(actor.id),
                changes=_changes_of(case, actor.id),
                before=old if moved else None,
                mistake=wrong.get(actor.id, ""),
            )
        )
    return tuple(bodies)


def _background(case: TestCase, project: Project) -> frozenset[str]:
    """Return the actors of a clip or mutant that were background traffic, are not changed by the mutation, and are not
    the clip's risk.
    """
    document = case.document
    folder = Path(document.path).parent if document is not None else Path()
    while document is not None and isinstance(document.model, m.Clip | m.Mutant):
        folder = Path(document.path).parent
        parent = folder / document.model.parent
        try:
            document = project.document(parent)
            scenario = None if isinstance(document.model, m.Clip | m.Mutant) else project.whole_scenario(parent)
        except InputError:
            return frozenset()
        if scenario is not None:
            drawn = {traffic.name for traffic in scenario.all(m.Traffic)}
            about = {change.actor for change in case.mutant.changes} if case.mutant is not None else set()
            about |= {case.clip.risk.actor or ""} if case.clip is not None and case.clip.risk is not None else set()
            names = (actor.name for actor in case.scenario.actors)
            return frozenset(name for name in names if name.rpartition("_")[0] in drawn and name not in about)
    return frozenset()


def _speed(actor: PlacedActor) -> str:
    if actor.control == "static":
        return "does not move"
    speed = f"{actor.speed_mps * 3.6:.0f} km/h"
    return "waits for a trigger" if actor.waits else f"starts with {speed}"


def _before(case: TestCase, project: Project) -> dict[str, FloatArray]:
    """Return the footprints that the actors of a mutant have in its clip, before the mutation."""
    if case.mutant is None:
        return {}
    try:
        parent = project.test_case(case.source.parent / case.mutant.parent)
    except InputError:
        return {}
    return {actor.id: np.array(footprint(actor)) for actor in sketch_case(parent).actors}


def _changes_of(case: TestCase, actor: str) -> tuple[str, ...]:
    if case.mutant is None:
        return ()
    return tuple(
        print_item(change).removeprefix(f"change {actor}.").replace(":", "", 1)
        for change in case.mutant.changes
        if change.actor == actor
    )


def _mistakes(sketch: Sketch, bodies: tuple[Body, ...]) -> Iterator[Mistake]:
    at = {body.name: body.middle for body in bodies}
    for problem, diagnostic in zip(sketch.problems, sketch.mistakes, strict=True):
        span = diagnostic.span
        text = None
        if span is not None:
            text = TextPlace(absolute(Path(diagnostic.path)), span.line, span.column, span.end_line)
        place = at.get(problem.actor)
        if place is None and (junction := sketch.network.junctions.get(problem.about)) is not None:
            place = junction.x, junction.y
        help_ = (": " + Help.of(problem.help)).text if problem.help else ""
        yield Mistake(f"{problem.text}{help_}", text, place)


# ---- ways -----------------------------------------------------------------------------------------------------------


def _ways(sketch: Sketch, texts: TextPlaces, tones: Mapping[str, Tone]) -> Iterator[ShownWay]:
    lines: dict[str, FloatArray] = {}
    for actor in sketch.actors:
        if tones[actor.id] == "traffic":
            continue
        if actor.line is not None:
            start = actor.line.project(actor.x, actor.y)[0]
            end = sketch.goal_s if actor.control == "ego" and sketch.goal_s > start else actor.line.end_s
            if end - start > 0.5:
                marks = np.append(np.arange(start, end, _STEP_M), end)
                lines[actor.id] = np.array([actor.line.at(s)[:2] for s in marks.tolist()])
        elif len(actor.path) > 1:
            lines[actor.id] = np.array(actor.path)
    for actor in sketch.actors:
        points = lines.get(actor.id)
        if points is None:
            continue
        path = actor.line is None
        others = [line for name, line in lines.items() if name != actor.id]
        yield ShownWay(
            actor=actor.id,
            kind="path" if path else "route",
            tone=tones[actor.id],
            points=points,
            matters_m=1e6 if path else _matters(points, others, ego=actor.control == "ego"),
            text=texts.actor(actor.id),
            goal=actor.control == "ego",
        )


def _later_ways(case: TestCase, sketch: Sketch, texts: TextPlaces, tones: Mapping[str, Tone]) -> Iterator[ShownWay]:
    """Yield the paths that actors follow after a trigger has fired."""
    for number, when in enumerate(case.scenario.all(m.When)):
        for action in all_actions(when.actions):
            if not isinstance(action, m.FollowsPath) or action.actor not in tones:
                continue
            places = [where_is(place, sketch) for place in action.points]
            points = [xy for xy in places if xy is not None]
            if len(points) > 1:
                text = texts.trigger(m.When, number)
                yield ShownWay(action.actor, "path", tones[action.actor], np.array(points), 1e6, text)


def _matters(points: FloatArray, others: list[FloatArray], *, ego: bool) -> float:
    """Return the length of a route, from its start, that should be visible, m: up to where it has met all
    other ways.
    """
    import shapely

    line = shapely.LineString(points)
    furthest = ALONE_M if ego or not others else ALONE_M / 2
    for other in others:
        # If both ways run side by side, it is enough that the first metres are visible.
        near = shapely.intersection(line, shapely.buffer(shapely.LineString(other), MEET_M / 2))
        if near.is_empty:
            continue
        first = min(line.project(shapely.Point(xy)) for xy in shapely.get_coordinates(near).tolist())
        furthest = max(furthest, first + MEET_M + BEYOND_M)
    return float(min(furthest, line.length))


# ---- the network ----------------------------------------------------------------------------------------------------


def _heads(
    network: RoadNetwork, signals: Mapping[str, Signal], stages: Mapping[str, tuple[str, float]]
) -> Iterator[SignalLine]:
    """Yield the signal heads at the start; a lane shows the colour of one of its movements: green before amber before
    red.
    """
    states: dict[str, str] = {}
    for name, signal in signals.items():
        stage, elapsed = stages.get(name, (signal.stages[0] if signal.stages else "", 0.0))
        try:
            phase, _ = signal.phase_at(stage, elapsed)
        except KeyError:
            continue
        states[signal.tls] = signal.phases[phase].state
    colours_of: dict[str, list[SignalColour]] = {}
    for movement in network.movements:
        state = states.get(movement.tls or "")
        if state is not None and 0 <= movement.link < len(state):
            colours_of.setdefault(movement.from_lane, []).append(colour_shown(state, movement.link))
    for lane_id, colours in colours_of.items():
        lane = network.lanes.get(lane_id)
        if lane is not None and not lane.internal and "car" in lane.kinds:
            yield SignalLine(stop_line(lane), next(colour for colour in _BEST_FIRST if colour in colours))


def _stops(model: m.Network | Path, network: RoadNetwork) -> Iterator[Name]:
    """Yield the names of the bus stops of a network that is written in the language."""
    for item in model.body if isinstance(model, m.Network) else ():
        stop = network.stops.get(item.name) if isinstance(item, m.BusStop) else None
        if isinstance(item, m.BusStop) and stop is not None and stop.outline:
            middle = np.array(stop.outline).mean(axis=0)
            yield Name("junction", f"stop {item.name}", middle.reshape(1, 2), True)


def _names(
    network: RoadNetwork,
    signals: Mapping[str, Signal],
    stages: Mapping[str, tuple[str, float]],
    matters: frozenset[str] | set[str],
    places: TextPlaces | Mapping[str, TextPlace | None],
) -> Iterator[Name]:
    def place(name: str) -> TextPlace | None:
        return places.network_item(name) if isinstance(places, TextPlaces) else places.get(name)

    for junction in network.junctions.values():
        if junction.id.startswith(":") or junction.type == "internal" or junction.id in network.joints:
            continue
        signal = signals.get(junction.id)
        note = ""
        if signal is not None and signal.stages:
            note = stages.get(junction.id, (signal.stages[0], 0.0))[0]
        middle = np.array(junction.polygon).mean(axis=0) if junction.polygon else np.array((junction.x, junction.y))
        yield Name("junction", junction.id, middle.reshape(1, 2), junction.id in matters, place(junction.id), note)
    roads: dict[str, tuple[float, str]] = {}
    for edge in network.edges.values():
        if edge.id.startswith(":") or not edge.for_kind("car"):
            continue
        base = _PART.sub("", edge.id).removeprefix("-")
        shape = edge.lanes[-1].shape
        length = sum(distance(p, q) for p, q in pairwise(shape))
        roads[base] = max(roads.get(base, (0.0, "")), (length, edge.id))
    on_way = {_PART.sub("", name).removeprefix("-") for name in matters}
    for base, (_, edge_id) in roads.items():
        lane = network.edges[edge_id].drivable[-1]
        yield Name("road", base, np.array(lane.shape), base in on_way, place(base))
