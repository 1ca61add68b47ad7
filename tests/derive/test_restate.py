"""Conditions said again in the middle of a run, checked against their definition frame by frame."""

from __future__ import annotations

import math
import random
from decimal import Decimal

import pytest

from foresee_dsl.derive.restate import Moment, restated
from foresee_dsl.language.conditions import parts
from foresee_dsl.language.model import (
    Both,
    Comparison,
    Condition,
    Either,
    Measure,
    Named,
    Not,
    Predicate,
    Quantity,
    Sustained,
    Within,
)

FRAMES = 50
Lights = dict[str, list[bool]]


def q(value: float, unit: str) -> Quantity:
    return Quantity(value=Decimal(str(round(value, 3))), unit=unit)


def fast(actor: str) -> Comparison:
    return Comparison(left=Measure(what="speed", actor=actor), op=">", right=q(1, "m/s"))


def lasts(condition: Condition, frames: int) -> Sustained:
    return Sustained(condition=condition, duration=q(frames * 0.05, "s"))


Row = list[bool | None]


def row(condition: Condition, lights: Lights, known: dict[int, Row] | None = None) -> Row:
    """The definition, at every frame: None where the run is not old enough to say."""
    known = {} if known is None else known
    if id(condition) not in known:
        known[id(condition)] = _row(condition, lights, known)
    return known[id(condition)]


def _row(condition: Condition, lights: Lights, known: dict[int, Row]) -> Row:
    frames = range(len(lights["a"]))
    if isinstance(condition, Not):
        return [None if inner is None else not inner for inner in row(condition.condition, lights, known)]
    if isinstance(condition, Both | Either):
        enough = isinstance(condition, Either)
        found = zip(*(row(part, lights, known) for part in condition.conditions), strict=True)
        return [enough if enough in values else None if None in values else not enough for values in found]
    if isinstance(condition, Sustained):
        span = math.ceil(condition.duration.si / 0.05 - 1e-6)
        inner = [None] * span + row(condition.condition, lights, known)
        windows = (inner[k : k + span + 1] for k in frames)
        return [False if False in seen else None if None in seen else True for seen in windows]
    assert isinstance(condition, Comparison)
    if condition.left.what == "time":
        right = condition.right.si
        return [t >= right if condition.op == ">=" else t < right for t in (round(k * 0.05, 6) for k in frames)]
    return list(lights[condition.left.actor])


def fires(condition: Condition, lights: Lights, frames: range, *, held: bool) -> list[int]:
    """When an `every` (`held`: a `next`) fires."""
    found, values = [], row(condition, lights)
    for k in frames:
        now = values[k]
        if now and not held:
            found.append(k)
        held = held if now is None else now
    return found


def since(condition: Condition, lights: Lights, frame: int) -> dict[int, float]:
    found = {}
    for number, part in enumerate(parts(condition)):
        values = row(part.condition, lights) if isinstance(part, Sustained) else [False] * FRAMES
        for k in range(frame, -1, -1):
            if not values[k]:
                break
            found[number] = k * 0.05
    return found


def cases(count: int) -> list[tuple[Lights, int]]:
    rng = random.Random(3)
    found = []
    for _ in range(count):
        lights = {}
        for actor in ("a", "b"):
            values: list[bool] = []
            while len(values) < FRAMES:
                values += [rng.random() < 0.7] * rng.randint(1, 14)
            lights[actor] = values[:FRAMES]
        found.append((lights, rng.randint(1, 25)))
    return found


def later(lights: Lights, frame: int) -> Lights:
    return {actor: values[frame:] for actor, values in lights.items()}


A, B = fast("a"), fast("b")
WHOLE = [
    Both(conditions=(lasts(A, 9), B)),
    Not(condition=lasts(A, 7)),
    Both(conditions=(Not(condition=lasts(Either(conditions=(A, B)), 8)), B)),
    lasts(Both(conditions=(lasts(A, 4), Not(condition=lasts(B, 11)))), 5),
]
SHORT = [lasts(A, 9), lasts(Either(conditions=(A, B)), 12), lasts(lasts(A, 4), 7), A]


@pytest.mark.parametrize("condition", [*WHOLE, *SHORT])
def test_it_is_true_at_the_same_frames(condition: Condition) -> None:
    for lights, frame in cases(60):
        again = restated(condition, Moment(frame * 0.05, frozenset(), {}), since(condition, lights, frame))
        assert not isinstance(again, bool)
        expected = [bool(value) for value in row(condition, lights)[frame:]]
        assert [bool(value) for value in row(again, later(lights, frame))] == expected, frame


@pytest.mark.parametrize("condition", SHORT)
def test_the_short_text_fires_at_the_same_frames(condition: Condition) -> None:
    for lights, frame in cases(80):
        before = fires(condition, lights, range(frame + 1), held=False)
        held = False
        for now in row(condition, lights)[: frame + 1]:
            held = held if now is None else now
        moment = Moment(frame * 0.05, frozenset(), {})
        again = restated(condition, moment, since(condition, lights, frame), short=True)
        assert not isinstance(again, bool)
        found = fires(again, later(lights, frame), range(FRAMES - frame), held=held)
        expected = fires(condition, lights, range(FRAMES), held=False)[len(before) :]
        assert [frame + k for k in found] == expected


def test_times_count_from_the_window() -> None:
    moment = Moment(2.0, frozenset(), {})

    def at(op: str, seconds: float) -> Condition | bool:
        return restated(Comparison(left=Measure(what="time"), op=op, right=q(seconds, "s")), moment)  # type: ignore[arg-type]  # a word

    assert at(">", 5.5) == Comparison(left=Measure(what="time"), op=">", right=q(3.5, "s"))
    assert (at(">", 1), at(">=", 2), at("<", 2), at("<=", 1.9)) == (True, True, False, False)
    assert at("<=", 2) == Comparison(left=Measure(what="time"), op="<=", right=q(0, "s"))
    assert at(">", 2.898) == Comparison(left=Measure(what="time"), op=">", right=q(0.898, "s"))


def test_what_is_known_of_who_is_gone_is_worked_in() -> None:
    moment = Moment(2.0, frozenset({"b"}), {})
    near = Within(actor="a", distance=q(5, "m"), of=Named(name="b"))
    arrived, hit = Predicate(what="arrived", actor="b"), Predicate(what="collision", actor="b")
    assert restated(near, moment) is False
    assert restated(Not(condition=near), moment) is False  # it cannot be said, and so it does not hold
    assert restated(Both(conditions=(arrived, A)), moment) == A
    assert restated(Either(conditions=(hit, near, A)), moment) == A
