"""How each class of the model is written: one function a class, found by the class."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, TypeVar

from foresee_dsl.language import model as m
from foresee_dsl.language import phrases as p
from foresee_dsl.language.nodes import Key

Parameters = frozenset[str]

_SHORT = 4
"""A road with at most so many settings is one line (ours; by number, not width, so that an edit never rewraps)."""


@dataclass(frozen=True, slots=True)
class Layout:
    """A statement to print: its head, and what is in its braces.

    `inside` is None for a statement without braces; otherwise the key of each inner statement in the model's path,
    and the item or (for a setting) its text. `inline`: in one line when nothing in it has a comment.
    """

    head: str
    inside: Sequence[tuple[Key, m.Item | str]] | None = None
    inline: bool = False


@dataclass(frozen=True, slots=True)
class _Registry:
    printers: dict[type[m.Item], Callable[[Any, Parameters], Layout]] = field(default_factory=dict)


_T = TypeVar("_T", bound=m.Item)
_registry = _Registry()


def layout(item: m.Item, parameters: Parameters) -> Layout:
    """Return how a statement is written.

    Args:
        item: any statement of the model.
        parameters: the names of the scenario's parameters (an id of the same name is quoted).
    """
    return _registry.printers[type(item)](item, parameters)


def _block(kind: type[_T]) -> Callable[[Callable[[_T, Parameters], Layout]], Callable[[_T, Parameters], Layout]]:
    """Register the function that lays out a class."""

    def register(function: Callable[[_T, Parameters], Layout]) -> Callable[[_T, Parameters], Layout]:
        _registry.printers[kind] = function
        return function

    return register


def _line(kind: type[_T]) -> Callable[[Callable[[_T, Parameters], str]], Callable[[_T, Parameters], str]]:
    """Register the function that writes a class whose statements have no braces."""

    def register(function: Callable[[_T, Parameters], str]) -> Callable[[_T, Parameters], str]:
        _registry.printers[kind] = lambda item, parameters: Layout(function(item, parameters))
        return function

    return register


def _body(items: Sequence[m.Item], name: str = "body") -> list[tuple[Key, m.Item | str]]:
    return [((name, k), item) for k, item in enumerate(items)]


# ---- definitions ---------------------------------------------------------------------------------------------------


@_block(m.Scenario)
def _scenario(item: m.Scenario, _: Parameters) -> Layout:
    return Layout(f"scenario {item.name}", _body(item.body))


@_block(m.Extension)
def _extension(item: m.Extension, _: Parameters) -> Layout:
    return Layout(f"scenario {item.name} extends {p.string(item.parent)}", _body(item.body))


def _held(word: str, item: m.Item, parameters: Parameters) -> Layout:
    """A statement with a word in front of it."""
    shape = layout(item, parameters)
    head = "network" if isinstance(item, m.Network) and item.name == "here" else shape.head
    inside = None if shape.inside is None else [(("item", *key), inner) for key, inner in shape.inside]
    return Layout(f"{word} {head}", inside, shape.inline)


@_block(m.Add)
def _add(item: m.Add, parameters: Parameters) -> Layout:
    return _held("add", item.item, parameters)


@_block(m.Replace)
def _replace(item: m.Replace, parameters: Parameters) -> Layout:
    return _held("change", item.item, parameters)


@_line(m.Drop)
def _drop(item: m.Drop, _: Parameters) -> str:
    return f"drop {item.what}" + (f" {p.identifier(item.name)}" if item.name is not None else "")


@_block(m.Clip)
def _clip(item: m.Clip, _: Parameters) -> Layout:
    case = f" case {item.case}" if item.case is not None else ""
    return Layout(f"clip {item.name} of {p.string(item.parent)}{case} pin {item.pin}", _body(item.body))


@_block(m.Mutant)
def _mutant(item: m.Mutant, _: Parameters) -> Layout:
    return Layout(f"mutant {item.name} of {p.string(item.parent)} pin {item.pin}", _body(item.body))


@_block(m.Network)
def _network(item: m.Network, _: Parameters) -> Layout:
    return Layout(f"network {item.name}", _body(item.body))


@_block(m.Catalogue)
def _catalogue(item: m.Catalogue, _: Parameters) -> Layout:
    return Layout(f"models {item.name}", _body(item.body))


# ---- scenarios -----------------------------------------------------------------------------------------------------


@_line(m.Doc)
def _doc(item: m.Doc, _: Parameters) -> str:
    return f"doc {p.string(item.text)}"


@_line(m.Tags)
def _tags(item: m.Tags, _: Parameters) -> str:
    return f"tags {p.listing(item.names)}"


@_line(m.UseNetwork)
def _use_network(item: m.UseNetwork, _: Parameters) -> str:
    return f"use network {p.string(item.path)}"


@_line(m.UseModels)
def _use_models(item: m.UseModels, _: Parameters) -> str:
    return f"use models {p.string(item.path)}"


@_line(m.Param)
def _param(item: m.Param, _: Parameters) -> str:
    text = f"param {item.name}: {item.type} = {p.word(item.default)}"
    if item.range is not None:
        text += f" in {p.value(item.range.low)}..{p.value(item.range.high)}{p.optional('step', item.range.step)}"
    elif item.options is not None:
        text += f" in {p.listing(p.word(option) for option in item.options)}"
    return text if item.distribution is None else f"{text} as {_distribution(item.distribution)}"


def _distribution(item: m.Distribution) -> str:
    if isinstance(item, m.Normal):
        return f"normal({p.value(item.mean)}, {p.value(item.deviation)})"
    if isinstance(item, m.Choice):
        return f"choice({', '.join(p.value(weight) for weight in item.weights)})"
    return item.kind


@_line(m.Require)
def _require(item: m.Require, parameters: Parameters) -> str:
    return f"require {p.condition(item.condition, parameters)}"


@_line(m.Cases)
def _cases(item: m.Cases, _: Parameters) -> str:
    return f"cases {p.value(item.count)} from seed {p.value(item.seed)}"


@_line(m.Weather)
def _weather(item: m.Weather, _: Parameters) -> str:
    settings = (("rain", item.rain), ("fog", item.fog), ("wetness", item.wetness), ("sun", item.sun))
    return "weather " + ", ".join(f"{name} {p.value(ratio)}" for name, ratio in settings if ratio is not None)


@_line(m.Expect)
def _expect(item: m.Expect, parameters: Parameters) -> str:
    within = p.optional("within", item.within)
    return f"expect {_label(item.name)}{item.mode}{within} {p.condition(item.condition, parameters)}"


def _label(name: str | None) -> str:
    return f"{name}: " if name is not None else ""


@_line(m.End)
def _end(item: m.End, _: Parameters) -> str:
    return f"end after {p.value(item.after)}"


@_line(m.SignalState)
def _signal(item: m.SignalState, parameters: Parameters) -> str:
    junction, stage = p.identifier(item.junction, parameters), p.identifier(item.stage, parameters)
    return f"signal {junction} stage {stage} elapsed {p.value(item.elapsed)}"


@_block(m.Case)
def _case(item: m.Case, _: Parameters) -> Layout:
    return Layout(f"case {item.name}", _body(item.values, "values") or None, inline=True)


@_line(m.Assignment)
def _assignment(item: m.Assignment, _: Parameters) -> str:
    return f"{item.name} = {p.word(item.value)}"


# ---- who takes part ------------------------------------------------------------------------------------------------


@_block(m.Ego)
def _ego(item: m.Ego, _: Parameters) -> Layout:
    return Layout(f"ego: {_model_and_state(item)}", _body(item.body) or None)


@_block(m.Actor)
def _actor(item: m.Actor, _: Parameters) -> Layout:
    return Layout(f"{item.kind} {item.name}: {_model_and_state(item)}", _body(item.body) or None)


def _model_and_state(item: m.Ego | m.Actor) -> str:
    model = item.model.name if isinstance(item.model, m.Ref) else item.model
    state = item.state
    if state is None:
        return model
    return (
        f"{model} at {p.point(state.at)} heading {p.value(state.heading)} speed {p.value(state.speed)}"
        f"{p.optional('acceleration', state.acceleration)}{p.optional('steer', state.steer)}"
    )


@_block(m.Traffic)
def _traffic(item: m.Traffic, _: Parameters) -> Layout:
    settings = {
        "count": f"count {p.value(item.count)}",
        "models": f"models {p.listing(item.models)}",
        "within": f"within {p.value(item.within)} of ego.route",
        "seed": f"seed {p.value(item.seed)}",
    }
    return Layout(f"traffic {item.name}", [((name,), text) for name, text in settings.items()])


@_line(m.Route)
def _route(item: m.Route, parameters: Parameters) -> str:
    legs = "".join(f" {p.identifier(leg.turn)} over {p.identifier(leg.junction, parameters)}" for leg in item.legs)
    return f"route from {p.identifier(item.start, parameters)}{legs}"


@_line(m.EdgeRoute)
def _edge_route(item: m.EdgeRoute, _: Parameters) -> str:
    edges = [p.identifier(edge) for edge in item.edges]
    if not item.shortest:
        return f"route {p.listing(edges)}"
    return f"route [{', ..., '.join(edges)}{', ...' if len(edges) == 1 else ''}]"


@_line(m.Path)
def _path(item: m.Path, parameters: Parameters) -> str:
    return f"path {p.listing(p.place(point, parameters) for point in item.points)}"


@_line(m.StartAt)
def _start_at(item: m.StartAt, parameters: Parameters) -> str:
    return f"start at {p.place(item.place, parameters)}"


@_line(m.StartSpeed)
def _start_speed(item: m.StartSpeed, _: Parameters) -> str:
    return f"start speed {p.value(item.speed)}"


@_line(m.CruiseSpeed)
def _cruise_speed(item: m.CruiseSpeed, _: Parameters) -> str:
    return f"speed {p.value(item.speed)}"


@_line(m.GoalAt)
def _goal_at(item: m.GoalAt, parameters: Parameters) -> str:
    return f"goal {p.place(item.place, parameters)}"


@_line(m.IgnoresRule)
def _ignores_rule(item: m.IgnoresRule, parameters: Parameters) -> str:
    return f"ignores {item.what}{_at(item.junction, parameters)}"


@_line(m.MeetsState)
def _meets_state(item: m.MeetsState, parameters: Parameters) -> str:
    return f"meets {item.other}{_at(item.junction, parameters)} {item.order} {p.value(item.gap)}"


@_line(m.Walked)
def _walked(item: m.Walked, _: Parameters) -> str:
    return f"moving {p.value(item.along)}"


@_line(m.Steers)
def _steers(item: m.Steers, _: Parameters) -> str:
    return f"steers {p.value(item.value)}{p.optional('from', item.start)}{p.optional('for', item.duration)}"


@_line(m.Timing)
def _timing(item: m.Timing, _: Parameters) -> str:
    return f"timing {p.value(item.factor)}"


@_line(m.Delay)
def _delay(item: m.Delay, _: Parameters) -> str:
    return f"delay {p.value(item.time)}"


def _at(junction: str | m.Ref | None, parameters: Parameters) -> str:
    return f" at {p.identifier(junction, parameters)}" if junction is not None else ""


# ---- triggers ------------------------------------------------------------------------------------------------------


@_block(m.When)
def _when(item: m.When, parameters: Parameters) -> Layout:
    repeat = f"{item.repeat} " if item.repeat is not None else ""
    head = f"when {repeat}{_label(item.name)}{p.condition(item.condition, parameters)}"
    return Layout(head, _body(item.actions, "actions"))


@_block(m.Then)
def _then(item: m.Then, parameters: Parameters) -> Layout:
    when = f" when {p.condition(item.condition, parameters)}" if item.condition is not None else ""
    return Layout(f"then{when}", _body(item.actions, "actions"))


@_line(m.Wait)
def _wait(item: m.Wait, _: Parameters) -> str:
    return f"wait {p.value(item.duration)}"


@_line(m.Meets)
def _meets(item: m.Meets, parameters: Parameters) -> str:
    return f"{item.actor} meets {item.other}{_at(item.junction, parameters)} {item.order} {p.value(item.gap)}"


@_line(m.Ignores)
def _ignores(item: m.Ignores, parameters: Parameters) -> str:
    return f"{item.actor} ignores {item.what}{_at(item.junction, parameters)}"


@_line(m.Starts)
def _starts(item: m.Starts, _: Parameters) -> str:
    return f"{item.actor} starts"


@_line(m.ChangesSpeed)
def _changes_speed(item: m.ChangesSpeed, _: Parameters) -> str:
    return f"{item.actor} changes speed to {p.value(item.to)}{p.optional('over', item.over)}"


@_line(m.ChangesLane)
def _changes_lane(item: m.ChangesLane, _: Parameters) -> str:
    return f"{item.actor} changes lane {p.identifier(item.side)}"


@_line(m.Stops)
def _stops(item: m.Stops, _: Parameters) -> str:
    return f"{item.actor} stops{p.optional('for', item.duration)}"


# ---- networks and catalogues ---------------------------------------------------------------------------------------


@_block(m.Junction)
def _junction(item: m.Junction, _: Parameters) -> Layout:
    said = item.control != "priority" or "control" in item.model_fields_set  # the default, where the author wrote it
    control = f" {item.control}" if said else ""
    inside: list[tuple[Key, m.Item | str]] = [(("crossings",), "crossings")] if item.crossings else []
    inside += _body(item.stages, "stages")
    return Layout(f"junction {item.name} at {p.point(item.at)}{control}", inside or None, inline=not item.stages)


@_line(m.Stage)
def _stage(item: m.Stage, _: Parameters) -> str:
    return f"stage {item.name} for {p.value(item.duration)} green {p.listing(item.green)}"


def _settings(item: m.Item, names: Sequence[str]) -> list[tuple[Key, m.Item | str]]:
    """The settings that are given, in the order of the names."""
    found = [(name, getattr(item, name)) for name in names]
    return [((name,), f"{name} {p.value(given)}") for name, given in found if given is not None]


@_block(m.Road)
def _road(item: m.Road, _: Parameters) -> Layout:
    inside = _settings(item, ("lanes", "back", "lane_width", "speed", "sidewalk", "median"))
    if item.via:
        inside.append((("via",), f"via {p.listing(p.point(at) for at in item.via)}"))
    inline = len(inside) <= _SHORT and not item.via
    return Layout(f"road {item.name} from {item.start} to {item.end}", inside or None, inline=inline)


@_block(m.VehicleModel)
def _vehicle_model(item: m.VehicleModel, _: Parameters) -> Layout:
    names = tuple(name for name in m.VehicleModel.model_fields if name not in ("kind", "name", "source"))
    inside = _settings(item, names)
    if item.source is not None:
        inside.append((("source",), f"source {p.string(item.source)}"))
    return Layout(f"model {item.name}", inside)


# ---- clips and mutants ---------------------------------------------------------------------------------------------


@_line(m.Window)
def _window(item: m.Window, _: Parameters) -> str:
    return f"window {p.value(item.start)}..{p.value(item.end)}"


@_line(m.Risk)
def _risk(item: m.Risk, _: Parameters) -> str:
    actor = f" with {item.actor}" if item.actor is not None else ""
    return f"risk {p.string(item.text)}{p.optional('at', item.at)}{actor}"


@_line(m.Goal)
def _goal(item: m.Goal, _: Parameters) -> str:
    return f"goal {p.point(item.at)}"


@_line(m.Fidelity)
def _fidelity(item: m.Fidelity, _: Parameters) -> str:
    return f"fidelity {p.value(item.deviation)}"


@_line(m.Change)
def _change(item: m.Change, _: Parameters) -> str:
    times = f"{p.optional('from', item.start)}{p.optional('for', item.duration)}"
    return f"change {item.actor}.{item.property}: {p.word(item.was)} => {p.word(item.now)}{times}"


@_block(m.Origin)
def _origin(item: m.Origin, _: Parameters) -> Layout:
    texts = {
        "operator": p.listing(item.operator) if item.operator else None,
        "preset": item.preset,
        "seed": p.value(item.seed) if item.seed is not None else None,
        "tool": _quoted(item.tool),
        "driver": _quoted(item.driver),
        "found": _quoted(item.found),
        "minimised": _quoted(item.minimised),
        "preventable": item.preventable,
    }
    return Layout("origin", [((name,), f"{name} {text}") for name, text in texts.items() if text is not None])


def _quoted(text: str | None) -> str | None:
    return p.string(text) if text is not None else None
