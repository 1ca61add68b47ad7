"""Definitions, and the statements of scenarios."""

from __future__ import annotations

from foresee_dsl.language import model as m
from foresee_dsl.language.printing import phrases as p
from foresee_dsl.language.printing.registry import MOST_INLINE, Layout, Parameters, block, body, layout, line


@block(m.Scenario)
def _scenario(item: m.Scenario, _: Parameters) -> Layout:
    return Layout(f"scenario {item.name}", body(item.body))


@block(m.Extension)
def _extension(item: m.Extension, _: Parameters) -> Layout:
    return Layout(f"scenario {item.name} extends {p.string(item.parent)}", body(item.body))


def _held(word: str, item: m.Item, parameters: Parameters) -> Layout:
    """A statement with a word in front of it."""
    shape = layout(item, parameters)
    head = "network" if isinstance(item, m.Network) and item.name == "here" else shape.head
    inside = None if shape.inside is None else [(("item", *key), inner) for key, inner in shape.inside]
    return Layout(f"{word} {head}", inside, shape.inline)


@block(m.Add)
def _add(item: m.Add, parameters: Parameters) -> Layout:
    return _held("add", item.item, parameters)


@block(m.Replace)
def _replace(item: m.Replace, parameters: Parameters) -> Layout:
    return _held("change", item.item, parameters)


@line(m.Drop)
def _drop(item: m.Drop, _: Parameters) -> str:
    return f"drop {item.what}" + (f" {p.identifier(item.name)}" if item.name is not None else "")


@block(m.Clip)
def _clip(item: m.Clip, _: Parameters) -> Layout:
    case = f" case {item.case}" if item.case is not None else ""
    return Layout(f"clip {item.name} of {p.string(item.parent)}{case} pin {item.pin}", body(item.body))


@block(m.Mutant)
def _mutant(item: m.Mutant, _: Parameters) -> Layout:
    return Layout(f"mutant {item.name} of {p.string(item.parent)} pin {item.pin}", body(item.body))


@block(m.Network)
def _network(item: m.Network, _: Parameters) -> Layout:
    return Layout(f"network {item.name}", body(item.body))


@block(m.Catalogue)
def _catalogue(item: m.Catalogue, _: Parameters) -> Layout:
    return Layout(f"models {item.name}", body(item.body))


@block(m.Campaign)
def _campaign(item: m.Campaign, _: Parameters) -> Layout:
    return Layout(f"campaign {item.name}", body(item.body))


@line(m.Seeds)
def _seeds(item: m.Seeds, _: Parameters) -> str:
    return f"seeds {p.string(item.path)}"


@line(m.Drivers)
def _drivers(item: m.Drivers, _: Parameters) -> str:
    return f"drivers {p.listing(p.identifier(name) for name in item.names)}"


@line(m.Rankers)
def _rankers(item: m.Rankers, _: Parameters) -> str:
    return f"rankers {p.listing(p.identifier(name) for name in item.names)}"


@line(m.Preset)
def _preset(item: m.Preset, _: Parameters) -> str:
    return f"preset {item.name}"


@line(m.ClipAround)
def _clip_around(item: m.ClipAround, _: Parameters) -> str:
    return f"clip before {p.value(item.before)} after {p.value(item.after)}"


@line(m.RiskyPoints)
def _risky_points(item: m.RiskyPoints, _: Parameters) -> str:
    return f"risky_points {p.value(item.count)}"


@line(m.Children)
def _children(item: m.Children, _: Parameters) -> str:
    return f"children {p.value(item.count)}"


@line(m.Repeat)
def _repeat(item: m.Repeat, _: Parameters) -> str:
    return f"repeat {p.value(item.times)}"


@line(m.FirstSeed)
def _first_seed(item: m.FirstSeed, _: Parameters) -> str:
    return f"seed {p.value(item.seed)}"


@line(m.Budget)
def _budget(item: m.Budget, _: Parameters) -> str:
    return f"budget {p.value(item.time)}"


@line(m.Doc)
def _doc(item: m.Doc, _: Parameters) -> str:
    return f"doc {p.string(item.text)}"


@line(m.Tags)
def _tags(item: m.Tags, _: Parameters) -> str:
    return f"tags {p.listing(item.names)}"


@line(m.UseNetwork)
def _use_network(item: m.UseNetwork, _: Parameters) -> str:
    return f"use network {p.string(item.path)}"


@line(m.UseModels)
def _use_models(item: m.UseModels, _: Parameters) -> str:
    return f"use models {p.string(item.path)}"


@line(m.Param)
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


@line(m.Require)
def _require(item: m.Require, parameters: Parameters) -> str:
    return f"require {p.condition(item.condition, parameters)}"


@line(m.Cases)
def _cases(item: m.Cases, _: Parameters) -> str:
    return f"cases {p.value(item.count)} from seed {p.value(item.seed)}"


@line(m.Weather)
def _weather(item: m.Weather, _: Parameters) -> str:
    settings = (("rain", item.rain), ("fog", item.fog), ("wetness", item.wetness), ("sun", item.sun))
    return "weather " + ", ".join(f"{name} {p.value(ratio)}" for name, ratio in settings if ratio is not None)


@line(m.Expect)
def _expect(item: m.Expect, parameters: Parameters) -> str:
    within = p.optional("within", item.within)
    return f"expect {p.label(item.name)}{item.mode}{within} {p.condition(item.condition, parameters)}"


@line(m.End)
def _end(item: m.End, _: Parameters) -> str:
    return f"end after {p.value(item.after)}"


@line(m.SignalState)
def _signal(item: m.SignalState, parameters: Parameters) -> str:
    junction, stage = p.identifier(item.junction, parameters), p.identifier(item.stage, parameters)
    return f"signal {junction} stage {stage} elapsed {p.value(item.elapsed)}"


@block(m.Case)
def _case(item: m.Case, _: Parameters) -> Layout:
    inline = len(item.values) <= MOST_INLINE
    return Layout(f"case {item.name}", body(item.values, "values") or None, inline=inline)


@line(m.Assignment)
def _assignment(item: m.Assignment, _: Parameters) -> str:
    return f"{item.name} = {p.word(item.value)}"
