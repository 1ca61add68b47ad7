"""Clips and mutants."""

from __future__ import annotations

from foresee_dsl.language import model as m
from foresee_dsl.language.printing import phrases as p
from foresee_dsl.language.printing.registry import Layout, Parameters, block, line


@line(m.Window)
def _window(item: m.Window, _: Parameters) -> str:
    return f"window {p.value(item.start)}..{p.value(item.end)}"


@line(m.Risk)
def _risk(item: m.Risk, _: Parameters) -> str:
    actor = f" with {item.actor}" if item.actor is not None else ""
    return f"risk {p.string(item.text)}{p.optional('at', item.at)}{actor}"


@line(m.Goal)
def _goal(item: m.Goal, _: Parameters) -> str:
    return f"goal {p.point(item.at)}"


@line(m.Fidelity)
def _fidelity(item: m.Fidelity, _: Parameters) -> str:
    return f"fidelity {p.value(item.deviation)}{p.optional('ego', item.ego)}"


@line(m.Change)
def _change(item: m.Change, _: Parameters) -> str:
    times = f"{p.optional('from', item.start)}{p.optional('for', item.duration)}"
    return f"change {item.actor}.{item.property}: {p.word(item.was)} => {p.word(item.now)}{times}"


@block(m.Origin)
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
