"""Who takes part: the ego, actors, traffic, and their statements."""

from __future__ import annotations

from foresee_dsl.language import model as m
from foresee_dsl.language.printing import phrases as p
from foresee_dsl.language.printing.registry import Layout, Parameters, block, body, line


@block(m.Ego)
def _ego(item: m.Ego, _: Parameters) -> Layout:
    return Layout(f"ego: {_model_and_state(item)}", body(item.body) or None)


@block(m.Actor)
def _actor(item: m.Actor, _: Parameters) -> Layout:
    return Layout(f"{item.kind} {item.name}: {_model_and_state(item)}", body(item.body) or None)


def _model_and_state(item: m.Ego | m.Actor) -> str:
    model = item.model.name if isinstance(item.model, m.Ref) else item.model
    return model if item.state is None else f"{model} {_state(item.state)}"


def _state(state: m.State) -> str:
    return (
        f"at {p.point(state.at)} heading {p.value(state.heading)} speed {p.value(state.speed)}"
        f"{p.optional('acceleration', state.acceleration)}{p.optional('steer', state.steer)}"
    )


@block(m.Traffic)
def _traffic(item: m.Traffic, _: Parameters) -> Layout:
    settings = {
        "count": f"count {p.value(item.count)}",
        "models": f"models {p.listing(item.models)}",
        "within": f"within {p.value(item.within)} of ego.route",
        "seed": f"seed {p.value(item.seed)}",
    }
    return Layout(f"traffic {item.name}", [((name,), text) for name, text in settings.items()])


@line(m.Route)
def _route(item: m.Route, parameters: Parameters) -> str:
    legs = "".join(f" {p.identifier(leg.turn)} over {p.identifier(leg.junction, parameters)}" for leg in item.legs)
    return f"route from {p.identifier(item.start, parameters)}{legs}"


@line(m.EdgeRoute)
def _edge_route(item: m.EdgeRoute, parameters: Parameters) -> str:
    edges = [p.identifier(edge, parameters) for edge in item.edges]
    if not item.shortest:
        return f"route {p.listing(edges)}"
    return f"route [{', ..., '.join(edges)}{', ...' if len(edges) == 1 else ''}]"


@line(m.Path)
def _path(item: m.Path, parameters: Parameters) -> str:
    return f"path {p.listing(p.place(point, parameters) for point in item.points)}"


@line(m.StartAt)
def _start_at(item: m.StartAt, parameters: Parameters) -> str:
    return f"start at {p.place(item.place, parameters)}"


@line(m.StartSpeed)
def _start_speed(item: m.StartSpeed, _: Parameters) -> str:
    return f"start speed {p.value(item.speed)}"


@line(m.CruiseSpeed)
def _cruise_speed(item: m.CruiseSpeed, _: Parameters) -> str:
    return f"speed {p.value(item.speed)}"


@line(m.GoalAt)
def _goal_at(item: m.GoalAt, parameters: Parameters) -> str:
    return f"goal {p.place(item.place, parameters)}"


@line(m.IgnoresRule)
def _ignores_rule(item: m.IgnoresRule, parameters: Parameters) -> str:
    return f"ignores {item.what}{p.at(item.junction, parameters)}"


@line(m.MeetsState)
def _meets_state(item: m.MeetsState, parameters: Parameters) -> str:
    return f"meets {item.other}{p.at(item.junction, parameters)} {item.order} {p.value(item.gap)}"


@line(m.Walked)
def _walked(item: m.Walked, _: Parameters) -> str:
    return f"moving {p.value(item.along)}"


@line(m.Steers)
def _steers(item: m.Steers, _: Parameters) -> str:
    return f"steers {p.value(item.value)}{p.optional('from', item.start)}{p.optional('for', item.duration)}"


@line(m.Timing)
def _timing(item: m.Timing, _: Parameters) -> str:
    return f"timing {p.value(item.factor)}"


@line(m.Delay)
def _delay(item: m.Delay, _: Parameters) -> str:
    return f"delay {p.value(item.time)}"


@line(m.Line)
def _line(item: m.Line, _: Parameters) -> str:
    return f"line {p.value(item.left)}"


@line(m.Recorded)
def _recorded(item: m.Recorded, _: Parameters) -> str:
    return f"recorded {p.value(item.time)} {_state(item.state)}"
