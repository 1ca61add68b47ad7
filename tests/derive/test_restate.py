"""Conditions said again in the middle of a run, checked against their definition frame by frame."""

from __future__ import annotations

import math
import random
import re
from itertools import takewhile

import pytest

from foresee_dsl.derive.clipping.conditions import rebased
from foresee_dsl.language.model import (
    Both,
    Comparison,
    Condition,
    Either,
    Measure,
    Named,
    Not,
    Predicate,
    Sustained,
    Within,
)
from foresee_dsl.language.printer import written as text_of
from foresee_dsl.language.traversal import parts
from foresee_dsl.simulate.trigger_record import ClipMoment, HoldingTime
from tests.support.worlds import q

FRAMES = 50
SINCE = re.compile(r" since -?[0-9.]+ s")
Lights = dict[str, list[bool]]


def fast(actor: str) -> Comparison:
    return Comparison(left=Measure(what="speed", actor=actor), op=">", right=q(1, "m/s"))


def lasts(condition: Condition, frames: int) -> Sustained:
    return Sustained(condition=condition, duration=q(round(frames * 0.05, 3), "s"))


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
        before: Row = []
        if condition.since is not None:
            before = [False, *[True] * math.floor(-condition.since.si / 0.05 + 1e-6)]
        inner = [*[None] * span, *before, *row(condition.condition, lights, known)]
        windows = (inner[k + len(before) : k + len(before) + span + 1] for k in frames)
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


def runs(
    condition: Condition, lights: Lights, frame: int, *, positive: bool = True, number: int = 0
) -> dict[int, HoldingTime]:
    """What a watch tells: since when what each `for` is about holds, what cannot be said counting so under `not`."""
    inner = {Not: "condition", Sustained: "condition", Both: "conditions", Either: "conditions"}.get(type(condition))
    if inner is None:
        return {}
    found: dict[int, HoldingTime] = {}
    if isinstance(condition, Sustained):
        values = row(condition.condition, lights)[: frame + 1]
        lasting = list(takewhile(lambda value: not positive if value is None else value, reversed(values)))
        if lasting:
            start = len(values) - len(lasting)
            earlier = condition.since is not None and not start
            known = earlier or (start > 0 and values[start - 1] is not None)
            found[number] = HoldingTime(condition.since.si if earlier else start * 0.05, known)
    several = getattr(condition, inner)
    after = number + 1
    for part in several if isinstance(several, tuple) else (several,):
        found |= runs(part, lights, frame, positive=positive ^ isinstance(condition, Not), number=after)
        after += sum(1 for _ in parts(part))
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
    Not(condition=lasts(lasts(A, 3), 6)),
    lasts(A, 9).model_copy(update={"since": q(-0.2, "s")}),
    Not(condition=lasts(A, 9).model_copy(update={"since": q(0, "s")})),
    Not(condition=Both(conditions=(lasts(A, 9), B))),
]
FOR = [lasts(A, 9), lasts(Either(conditions=(A, B)), 12), lasts(lasts(A, 4), 7), A]
EITHER = [Either(conditions=(lasts(A, 9), B)), Either(conditions=(lasts(A, 6), Not(condition=lasts(B, 5))))]


def any_condition(rng: random.Random, depth: int) -> Condition:
    lot = rng.random()
    if not depth or lot < 0.15:
        return rng.choice([A, B])
    if lot < 0.55:
        found = lasts(any_condition(rng, depth - 1), rng.randint(0, 12))
        since = q(round(-0.05 * rng.randint(0, 15), 3), "s") if rng.random() < 0.2 else None
        return found.model_copy(update={"since": since})
    if lot < 0.7:
        return Not(condition=any_condition(rng, depth - 1))
    several = (any_condition(rng, depth - 1), any_condition(rng, depth - 1))
    return Both(conditions=several) if rng.random() < 0.5 else Either(conditions=several)


RNG = random.Random(8)
ANY = [any_condition(RNG, 3) for _ in range(60)]


@pytest.mark.parametrize("condition", [*WHOLE, *FOR, *EITHER, *ANY])
def test_it_is_true_at_the_same_frames(condition: Condition) -> None:
    for lights, frame in cases(40):
        again = rebased(condition, ClipMoment(frame * 0.05, frozenset(), {}), runs(condition, lights, frame))
        assert not isinstance(again, bool)
        expected = [bool(value) for value in row(condition, lights)[frame:]]
        assert [bool(value) for value in row(again, later(lights, frame))] == expected, frame


@pytest.mark.parametrize("condition", [*FOR, *EITHER, *WHOLE, *ANY])
def test_an_every_fires_at_the_same_frames(condition: Condition) -> None:
    for lights, frame in cases(40):
        before = fires(condition, lights, range(frame + 1), held=False)
        held = False
        for now in row(condition, lights)[: frame + 1]:
            held = held if now is None else now
        again = rebased(condition, ClipMoment(frame * 0.05, frozenset(), {}), runs(condition, lights, frame), held=held)
        assert not isinstance(again, bool)
        found = fires(again, later(lights, frame), range(FRAMES - frame), held=held)
        expected = fires(condition, lights, range(FRAMES), held=False)[len(before) :]
        assert [frame + k for k in found] == expected


@pytest.mark.parametrize("condition", [*WHOLE, *FOR, *EITHER])
def test_a_for_that_is_half_way_says_since_and_nothing_else(condition: Condition) -> None:
    found = set()
    for lights, frame in cases(60):
        again = rebased(condition, ClipMoment(frame * 0.05, frozenset(), {}), runs(condition, lights, frame))
        assert not isinstance(again, bool)
        found.add(SINCE.sub("", text_of(again)))
    assert found == {SINCE.sub("", text_of(condition))}


def test_a_clip_of_a_clip_adds_up() -> None:
    condition = lasts(A, 40).model_copy(update={"since": q(-1.3, "s")})
    lights = {"a": [True] * FRAMES, "b": [True] * FRAMES}
    again = rebased(condition, ClipMoment(0.5, frozenset(), {}), runs(condition, lights, 10))
    assert isinstance(again, Sustained)
    assert text_of(again) == "a.speed > 1 m/s for 2.0 s since -1.80 s"
    assert rebased(condition, ClipMoment(0.5, frozenset(), {})) == again  # a step that nobody has looked at


def test_times_count_from_the_window() -> None:
    moment = ClipMoment(2.0, frozenset(), {})

    def at(op: str, seconds: float) -> Condition | bool:
        return rebased(Comparison(left=Measure(what="time"), op=op, right=q(seconds, "s")), moment)  # type: ignore[arg-type]  # a word

    assert at(">", 5.5) == Comparison(left=Measure(what="time"), op=">", right=q(3.5, "s"))
    assert (at(">", 1), at(">=", 2), at("<", 2), at("<=", 1.9)) == (True, True, False, False)
    assert at("<=", 2) == Comparison(left=Measure(what="time"), op="<=", right=q(0, "s"))
    assert at(">", 2.898) == Comparison(left=Measure(what="time"), op=">", right=q(0.898, "s"))


def test_what_is_known_of_who_is_gone_is_worked_in() -> None:
    moment = ClipMoment(2.0, frozenset({"b"}), {})
    near = Within(actor="a", distance=q(5, "m"), of=Named(name="b"))
    arrived, hit = Predicate(what="arrived", actor="b"), Predicate(what="collision", actor="b")
    assert rebased(near, moment) is False
    assert rebased(Not(condition=near), moment) is False  # it cannot be said, and so it does not hold
    assert rebased(Both(conditions=(arrived, A)), moment) == A
    assert rebased(Either(conditions=(hit, near, A)), moment) == A
