"""Triggers and their actions."""

from __future__ import annotations

from foresee_dsl.language import model as m
from foresee_dsl.language.printing import phrases as p
from foresee_dsl.language.printing.registry import Layout, Parameters, block, body, line


@block(m.When)
def _when(item: m.When, parameters: Parameters) -> Layout:
    repeat = f"{item.repeat} " if item.repeat is not None else ""
    head = f"when {repeat}{p.label(item.name)}{p.condition(item.condition, parameters)}"
    return Layout(head, body(item.actions, "actions"))


@block(m.Then)
def _then(item: m.Then, parameters: Parameters) -> Layout:
    when = f" when {p.condition(item.condition, parameters)}" if item.condition is not None else ""
    return Layout(f"then{when}", body(item.actions, "actions"))


@line(m.Wait)
def _wait(item: m.Wait, _: Parameters) -> str:
    return f"wait {p.value(item.duration)}"


@line(m.Meets)
def _meets(item: m.Meets, parameters: Parameters) -> str:
    return f"{item.actor} meets {item.other}{p.at(item.junction, parameters)} {item.order} {p.value(item.gap)}"


@line(m.Ignores)
def _ignores(item: m.Ignores, parameters: Parameters) -> str:
    return f"{item.actor} ignores {item.what}{p.at(item.junction, parameters)}"


@line(m.Starts)
def _starts(item: m.Starts, _: Parameters) -> str:
    return f"{item.actor} starts"


@line(m.ChangesSpeed)
def _changes_speed(item: m.ChangesSpeed, _: Parameters) -> str:
    return f"{item.actor} changes speed to {p.value(item.to)}{p.optional('over', item.over)}"


@line(m.ChangesLane)
def _changes_lane(item: m.ChangesLane, _: Parameters) -> str:
    return f"{item.actor} changes lane {p.identifier(item.side)}"


@line(m.Stops)
def _stops(item: m.Stops, _: Parameters) -> str:
    return f"{item.actor} stops{p.optional('for', item.duration)}"
