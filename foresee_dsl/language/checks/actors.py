"""Checks of actors: their names, their models' classes, their positions, and the actors that other statements name."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from foresee_dsl.errors import subject, with_article
from foresee_dsl.helps import HelpText, in_block, one_of, remove, rename, write
from foresee_dsl.language import model as m
from foresee_dsl.language.messages.collector import Collector
from foresee_dsl.language.messages.suggest import closest, did_you_mean
from foresee_dsl.language.model_classes import CLASSES, VEHICLE_CLASSES
from foresee_dsl.language.printer import print_item, written
from foresee_dsl.language.traversal import all_actions, walk

_PATHS = ("path", "path_along")
_WAYS = ("route", "edge_route", *_PATHS)
_PASSING_CLASSES = ("bicycle", "motorcycle")
_SET_LINE = (m.ChangesLine, m.KeepsBeside, m.FollowsPath, m.Reverses)
_MAY_REPEAT = ("ignores", "meets_state", "recorded")
_OTHERS_SHOWN = 4
"""Largest number of actors that a help names as examples. Ours."""


def check_actors(collector: Collector, scenario: m.Scenario | m.Clip) -> None:
    """Check the actors of a scenario or clip, and every place that names an actor."""
    body: Sequence[m.Item] = scenario.body
    actors = [item for item in body if isinstance(item, (m.Ego, m.Actor))]
    groups, named, ego = scenario.all(m.Traffic), scenario.all(m.Actor), scenario.first(m.Ego)
    for other in [actor for actor in named if actor.name == "ego"][:1]:
        collector.add(
            other, "name", "FS030", "only the ego can have the name 'ego'", rename("give this actor another name")
        )
    for other in named:
        if other.name in m.TAKEN or other.name in m.OWNERS:
            message = "'" + subject(other.name) + "' is a word of the language"
            collector.add(other, "name", "FS049", message, rename("give this actor another name", everywhere=True))
    collector.unique([*named, *groups], "actors")
    cases = scenario.all(m.Case)
    parameters = {item.name: item for item in scenario.all(m.Param)}
    drawn = {group.name: _most(group.count, parameters, cases) for group in groups}
    _check_names_of_traffic(collector, named, drawn)
    for actor in actors:
        _check_place(collector, actor, ego)
        _check_once(collector, actor)
        _check_joins(collector, actor)
        _check_track(collector, actor)
        _check_times(collector, actor)
        _check_recorded(collector, actor)
        _check_class(collector, actor, parameters, cases)
        if isinstance(actor, m.Ego):
            _check_ego(collector, actor)
        else:
            _check_passes(collector, actor, parameters, cases, body)
            _check_style(collector, actor)
    for group in groups:
        for k, model in enumerate(group.models):
            _known_class(collector, group, f"models.{k}", model)
    _check_deviation(collector, body, ego)
    doors = {door_of(part) for when in scenario.all(m.When) for part in walk(when) if isinstance(part, m.Door)}
    _check_mentions(collector, body, {"ego", *(a.name for a in actors)}, drawn, doors)
    _check_pairs(collector, actors, scenario.all(m.When))


def _most(count: m.AnyValue, parameters: dict[str, m.Param], cases: Sequence[m.Case]) -> int | None:
    """Return the largest count of a traffic that some case can have; None if it must be calculated."""
    values: list[object] = [count]
    if isinstance(count, m.Ref):
        parameter = parameters.get(count.name)
        if parameter is None:
            return None
        assigned = (assignment for case in cases for assignment in case.values)
        values = [parameter.default, *(parameter.options or ())]
        values += [parameter.range.high] if parameter.range is not None else []
        values += [assignment.value for assignment in assigned if assignment.name == count.name]
    counts = [int(value.si) for value in values if isinstance(value, m.Quantity)]
    return max(counts) if len(counts) == len(values) else None


def _is_drawn(name: str, drawn: Mapping[str, int | None]) -> bool:
    """Return whether an actor of the traffic has this name in some case; `drawn` holds the largest counts."""
    traffic, _, number = name.rpartition("_")
    if traffic not in drawn or not number.isdecimal() or name != m.name_in_traffic(traffic, int(number)):
        return False
    most = drawn[traffic]
    return int(number) >= 1 and (most is None or int(number) <= most)


def _one_of_traffic(traffic: str, number: int, most: int | None) -> HelpText:
    """Return the help for the name of an actor that a traffic does not have."""
    if most == 0:
        return f"traffic '{traffic}' has no actors: raise its count, or " + remove("remove this")
    named = m.name_in_traffic(traffic, max(1, min(number, number if most is None else most)))
    if most is None:
        return "its actors are called like " + write(named)
    return f"traffic '{traffic}' has {most} {'actor' if most == 1 else 'actors'}: write " + write(named)


def _check_names_of_traffic(collector: Collector, named: Sequence[m.Actor], drawn: Mapping[str, int | None]) -> None:
    """Report an actor with the name of an actor of the traffic."""
    for actor in named:
        if _is_drawn(actor.name, drawn):
            traffic = actor.name.rpartition("_")[0]
            message = f"'{actor.name}' is also the name of an actor of traffic '{traffic}'"
            collector.add(actor, "name", "FS030", message, rename("give this actor another name", everywhere=True))


def _check_pairs(collector: Collector, actors: Sequence[m.Ego | m.Actor], triggers: Sequence[m.When]) -> None:
    """Report an action whose other actor is the actor itself, such as that of an actor which follows itself."""
    pairs: list[tuple[m.Item, str]] = [(item, actor.name) for actor in actors for item in actor.all(m.MeetsState)]
    actions = (action for when in triggers for action in all_actions(when.actions))
    pairs += [(action, action.actor) for action in actions if not isinstance(action, m.WithoutActor)]
    for item, name in pairs:
        if vars(item).get("other") == name:
            others = [actor.name for actor in actors if actor.name != name][:_OTHERS_SHOWN]
            help: HelpText = remove("remove it")
            if others:
                help = "name another actor, such as " + one_of(others, wrong=name)
            collector.add(item, "other", "FS050", f"'{name}' is the actor itself: another one is needed here", help)


def _check_place(collector: Collector, actor: m.Ego | m.Actor, ego: m.Ego | None) -> None:
    """Report an actor without a position, and a moving actor without a route or path."""
    kinds = {item.kind for item in actor.body}
    moves = bool(kinds & set(_WAYS))
    if isinstance(actor, m.Ego):
        if not moves or kinds & set(_PATHS):
            help = "write it like " + write("route from south straight over j4")
            collector.add(actor, "", "FS042", "the ego has no route", help, head_only=True)
        return
    placed = (
        actor.state is not None
        or moves
        or "track" in kinds
        or ("start_at" in kinds and actor.kind in ("obstacle", "pedestrian"))
    )
    if not placed:
        help = "add one, such as " + write("path [(0 m, 0 m), (20 m, 0 m)]")
        if actor.kind != "pedestrian":
            ways = [print_item(item) for item in ego.body if item.kind in _WAYS] if ego is not None else []
            help = "add one, such as " + write(ways[0] if ways else "route from south straight over j4")
        if actor.kind == "obstacle":
            help = "add " + write("start at 20 m along ego.route") + ", or a position before the brace"
        missing = {"obstacle": "position", "pedestrian": "path"}.get(actor.kind, "route or path")
        collector.add(actor, "", "FS042", f"'{actor.name}' has no {missing}", help, head_only=True)
    elif actor.state is not None and not moves and "track" not in kinds and _is_positive(actor.state.speed):
        missing = "path" if actor.kind == "pedestrian" else "route or path"
        help = f"add a {missing}, or write " + write("0 m/s")
        collector.add(actor.state, "speed", "FS042", f"'{actor.name}' has a speed, but no {missing}", help)


def _is_positive(value: m.AnyValue | None) -> bool:
    return isinstance(value, m.Quantity) and value.si > 0


def _check_joins(collector: Collector, actor: m.Ego | m.Actor) -> None:
    """Report an actor that joins the traffic but has no path to come from."""
    for item in actor.all(m.Joins):
        if not any(isinstance(other, m.AnyPath | m.Track) for other in actor.body):
            help = "write " + write("path [PLACE, PLACE]") + " before it, or `route [...]` instead"
            message = f"'{actor.name}' joins the traffic at the end of a path, but it has no path"
            collector.add(item, "", "FS042", message, help)


def _check_track(collector: Collector, actor: m.Ego | m.Actor) -> None:
    """Report what an actor that follows a recorded track cannot have, because the track decides it."""
    if isinstance(actor, m.Ego) or not actor.all(m.Track):
        return
    if actor.state is not None:
        help = "the track gives it its position: leave the other one out"
        collector.add(actor, "", "FS042", f"'{actor.name}' has a position and a track", help, head_only=True)
    for item in actor.body:
        if not isinstance(item, m.BESIDE_TRACK):
            what = written(item).split("(")[0].split("[")[0].strip()
            message = f"'{actor.name}' follows its track, so it cannot have `{what}`"
            collector.add(item, "", "FS042", message, remove("remove it") + ", or the track")
        later = isinstance(item, m.Line) and isinstance(item.start, m.Quantity) and item.start.si > 0
        if isinstance(item, m.Line) and (later or item.duration is not None):
            message = f"'{actor.name}' follows its track, so its `line` cannot have times"
            collector.add(item, "", "FS042", message, "leave out " + write("from") + " and " + write("for"))


def _check_deviation(collector: Collector, body: Sequence[m.Item], ego: m.Ego | None) -> None:
    """Report a measured deviation of an actor that is not the ego, or of an ego without a track."""
    recorded = ego is not None and bool(ego.all(m.Track))
    for measure in (part for item in body if isinstance(item, m.When | m.Expect) for part in walk(item)):
        if not isinstance(measure, m.Measure) or measure.what != "deviation":
            continue
        if measure.actor != "ego":
            follows = subject(f"{measure.actor}") + " follows its own exactly"
            message = "only the ego deviates from its track: " + follows
            collector.add(measure, "actor", "FS042", message, "write " + write("ego.deviation"))
        elif not recorded and ego is not None:
            help = in_block('track "112"', "ego") + " with the name of its recorded track"
            collector.add(measure, "", "FS042", "the ego has no recorded track from which it could deviate", help)


_DRIVERS: Mapping[type[m.Item], str] = {
    m.Brakes: "when it brakes",
    m.IgnoresRule: "which rules it keeps",
    m.Line: "where in its lane it drives",
    m.MeetsState: "how fast it drives",
    m.PassesInLane: "where in its lane it drives",
    m.Steers: "how it steers",
    m.Style: "how it drives",
    m.Timing: "how fast it drives",
}
"""Statements that the ego cannot have, and what its driver decides instead."""


def _check_ego(collector: Collector, ego: m.Ego) -> None:
    """Report statements of the ego that would have no effect, because its driver drives it."""
    for item in ego.body:
        if why := _DRIVERS.get(type(item)):
            words = item.pattern.partition("{")[0].strip()
            message = f"the ego cannot have `{words}`, because its driver decides {why}"
            collector.add(item, "", "FS042", message, "move it to another actor, or " + remove("remove it"))


def _check_times(collector: Collector, actor: m.Ego | m.Actor) -> None:
    """Report a `line` with times for an actor on a path."""
    on_path = any(isinstance(item, m.AnyPath) for item in actor.body)
    for item in actor.body:
        if isinstance(item, m.Line) and on_path and (item.start is not None or item.duration is not None):
            message = f"'{actor.name}' follows a path, so its `line` cannot have times"
            collector.add(item, "", "FS042", message, "leave out " + write("from") + " and " + write("for"))


def _check_style(collector: Collector, actor: m.Ego | m.Actor) -> None:
    """Report a style of an actor that SUMO does not drive along lanes."""
    for item in actor.all(m.Style):
        if not any(isinstance(other, m.Route | m.EdgeRoute) for other in actor.body):
            message = f"'{actor.name}' does not drive along a route, so it cannot have a `style`"
            collector.add(item, "", "FS042", message, "move it to a vehicle on a route, or " + remove("remove it"))


def _check_passes(
    collector: Collector,
    actor: m.Ego | m.Actor,
    parameters: dict[str, m.Param],
    cases: Sequence[m.Case],
    body: Sequence[m.Item],
) -> None:
    """Report a `passes in lane` that has no effect: only bicycles and motorcycles on lanes can have it, and no other
    statement may set their line."""
    statement = actor.first(m.PassesInLane)
    if statement is None:
        return
    passes = write("passes in lane")
    classes = {model.partition(".")[0] for _, _, model in _models(actor, parameters, cases)}
    if not classes <= set(_PASSING_CLASSES):
        message = f"'{actor.name}' is too wide to pass within a lane"
        help = passes + " is for bicycles and motorcycles: " + remove("remove it")
        collector.add(statement, "", "FS042", message, help)
    if any(isinstance(item, m.AnyPath) for item in actor.body):
        message = f"'{actor.name}' follows a path, which fixes its line, so it cannot have `passes in lane`"
        collector.add(statement, "", "FS042", message, "write a route instead of the path, or " + remove("remove it"))
    for line in actor.all(m.Line):
        message = f"'{actor.name}' passes within its lane, so SUMO decides its line and `line` has no effect"
        collector.add(line, "", "FS042", message, remove("keep one of the two"))
    for action in (part for item in body if isinstance(item, m.When) for part in walk(item)):
        if isinstance(action, _SET_LINE) and action.actor == actor.name:
            message = f"'{actor.name}' passes within its lane, so SUMO decides its line and this action has no effect"
            help = remove("remove this action") + ", or `passes in lane` from the actor"
            collector.add(action, "", "FS042", message, help)


def _check_once(collector: Collector, actor: m.Ego | m.Actor) -> None:
    seen: dict[str, m.Item] = {}
    for item in actor.body:
        kind = "way" if item.kind in _WAYS else item.kind
        if kind in seen and kind not in _MAY_REPEAT:
            what = "route or path" if kind == "way" else "statement of this kind"
            collector.add(item, "", "FS047", f"'{actor.name}' has a second {what}", remove("keep one of the two"))
        seen[kind] = item


def _check_recorded(collector: Collector, actor: m.Ego | m.Actor) -> None:
    """Report recorded states of an actor other than the ego, and recorded states whose times do not increase."""
    before = 0.0
    for item in actor.all(m.Recorded):
        if isinstance(actor, m.Actor):
            message = f"'{actor.name}' has a recorded state, but only the ego can follow recorded states"
            collector.add(item, "", "FS056", message, remove("remove it"))
        elif isinstance(item.time, m.Quantity):
            if item.time.si <= before:
                message = "the time of this recorded state is not later than that of the state before it"
                collector.add(item, "time", "FS056", message, "write the recorded states in the order of their times")
            before = item.time.si


def _check_class(
    collector: Collector, actor: m.Ego | m.Actor, parameters: dict[str, m.Param], cases: Sequence[m.Case]
) -> None:
    """Report a keyword that does not fit the model's class, for every model that a parameter can be."""
    for item, field, model in _models(actor, parameters, cases):
        if not _known_class(collector, item, field, model):
            continue
        wanted = VEHICLE_CLASSES if actor.kind in ("ego", "vehicle") else (actor.kind,)
        class_ = model.partition(".")[0]
        if class_ not in wanted:
            keyword = "vehicle" if class_ in VEHICLE_CLASSES else class_
            help = write(actor.kind) + f" takes models of the classes {', '.join(wanted)}"
            if isinstance(actor, m.Actor) and item is actor:
                help = "write " + write(f"{keyword} {actor.name}: {model}") + ", or take a model of "
                help += one_of(wanted, " or ")
            kind = "vehicle" if isinstance(actor, m.Ego) else actor.kind
            message = f"'{actor.name}' is {with_article(kind)}, but `{model}` is of class {class_}"
            collector.add(item, field, "FS038", message, help)


def _models(
    actor: m.Ego | m.Actor, parameters: dict[str, m.Param], cases: Sequence[m.Case]
) -> Iterator[tuple[m.Item, str, str]]:
    """Yield every model that an actor can have in some case, each with the item and the field that names it."""
    if isinstance(actor.model, str):
        yield actor, "model", actor.model
        return
    parameter = parameters.get(actor.model.name)
    if parameter is None or parameter.type != "model":
        return
    if isinstance(parameter.default, str) and "." in parameter.default:
        yield parameter, "default", parameter.default
    for k, option in enumerate(parameter.options or ()):
        if isinstance(option, str) and "." in option:
            yield parameter, f"options.{k}", option
    for case in cases:
        for assignment in case.values:
            if assignment.name == parameter.name and isinstance(assignment.value, str) and "." in assignment.value:
                yield assignment, "value", assignment.value


def _known_class(collector: Collector, item: m.Item, field: str, model: str) -> bool:
    class_ = model.partition(".")[0]
    if class_ in CLASSES:
        return True
    help = did_you_mean(class_, CLASSES)
    if closest(class_, CLASSES) is None:
        help = f"classes are {', '.join(CLASSES)}: write a model such as " + write("car.sedan")
    collector.add(item, field, "FS012", f"unknown class of models '{class_}'", help)
    return False


def door_of(action: m.Door) -> str:
    """Return the name of the door that an action opens or shuts."""
    return m.door_name(action.actor, action.side if isinstance(action.side, str) else "left")


def _check_mentions(
    collector: Collector, body: Sequence[m.Item], actors: set[str], drawn: Mapping[str, int | None], doors: set[str]
) -> None:
    """Report mentions of actors that do not exist. Actors of the traffic are called `others_03`, doors `van_door`."""
    for root in body:
        for item in walk(root):
            # The second name of this measure is a junction, not an actor.
            place = isinstance(item, m.Measure) and item.what not in m.BETWEEN_ACTORS
            fields = vars(item)  # not `getattr`: pydantic is slow for a field that the class does not have
            named = [(field, fields.get(field)) for field in (("actor",) if place else ("actor", "other"))]
            for field, name in ((field, name) for field, name in named if isinstance(name, str)):
                group, _, number = name.rpartition("_")
                if name in actors or name in doors or _is_drawn(name, drawn):
                    continue
                help: HelpText = did_you_mean(name, sorted(actors))
                if name in drawn:
                    help = "name one of its actors: " + write(m.name_in_traffic(name, 1))
                elif group in drawn and number.isdecimal():
                    help = _one_of_traffic(group, int(number), drawn[group])
                collector.add(item, field, "FS037", "unknown actor '" + subject(name) + "'", help)
