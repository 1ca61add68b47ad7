"""Clips and mutants as full scenarios: what `foresee expand` prints, and what is compiled and run."""

from __future__ import annotations

from pathlib import Path
from typing import TypeVar

from foresee_dsl.language.changes import changed_body, weakened
from foresee_dsl.language.codes.names import EMPTY_WINDOW, INCOMPLETE_CLIP, WEAKENED
from foresee_dsl.language.meaning import meaning_hash
from foresee_dsl.language.messages.findings import Findings
from foresee_dsl.language.model import (
    Actor,
    AlongRoute,
    Clip,
    Condition,
    Ego,
    End,
    Expect,
    Goal,
    GoalAt,
    Mutant,
    Network,
    PastJunction,
    Quantity,
    Scenario,
    ScenarioItem,
    SignalState,
    Tags,
    UseModels,
    UseNetwork,
    Weather,
    When,
    Window,
    Within,
)
from foresee_dsl.language.project.addresses import absolute, relative_to
from foresee_dsl.language.project.catalogues import check_models
from foresee_dsl.language.project.concretise import concretise, value_text
from foresee_dsl.language.project.document import Document, TestCase
from foresee_dsl.language.traversal import mentioned, parts

_T = TypeVar("_T")
_Participant = Ego | Actor


def expand_clip(clip: Clip, parent: TestCase, *, source: Path, document: Document | None = None) -> TestCase:
    """Make the full scenario of a clip.

    Network, models, tags, weather and expectations are the parent's; everything that moves is the clip's. Left out are
    expectations that something happens `eventually` (a window cannot judge them: it may have happened before, and the
    clip ends with its window), those about actors that the clip does not have, and those about places along a route
    (which begins elsewhere in the clip).

    Args:
        clip: as written.
        parent: what it was cut from.
        source: the clip's file (it need not exist yet); paths in the result are relative to its folder.
        document: gives the errors their places, and the test case its document.

    Raises:
        InputError: no ego, no window, a window without length, or an unknown or unfitting model.
    """
    name = document.path if document is not None else source.as_posix()
    source = absolute(source)
    findings = Findings(document, name)
    ego, length = _essentials(clip, findings)
    actors = tuple(item for item in clip.body if isinstance(item, Actor))
    body: tuple[ScenarioItem, ...] = (
        *parent.scenario.all(Tags),
        *surroundings(parent, source.parent),
        *parent.scenario.all(Weather),
        _with_goal(ego, _first(clip, Goal)),
        *actors,
        *(item for item in clip.body if isinstance(item, SignalState)),
        *(item for item in clip.body if isinstance(item, When)),
        *_expectations(parent.scenario, frozenset(actor.name for actor in actors)),
        End(after=length),
    )
    # A clip has no parameters: a bare name where a value belongs is reported here.
    scenario = concretise(Scenario(name=clip.name, body=body), None, document=document)
    check_models(scenario, parent.models, document, None)
    return TestCase(
        id=name,
        scenario=scenario,
        network=parent.network,
        models=parent.models,
        meaning=meaning_hash(scenario, parent.network, parent.models),
        source=source,
        document=document,
        clip=clip,
    )


def expand_mutant(mutant: Mutant, clip_case: TestCase, *, source: Path, document: Document | None = None) -> TestCase:
    """Make the full scenario of a mutant: the clip's, with every `change` line applied in order.

    A change of `steer`, `timing` or `delay` replaces what the actor had.

    Args:
        mutant: as written.
        clip_case: the clip (or another mutant of it) that it changes.
        source: the mutant's file (it need not exist yet).
        document: gives the errors their places, and the test case its document.

    Raises:
        InputError: an unknown actor or model, a WAS that is not what the clip has, a NOW that does not fit, or an
            expectation that is easier to meet than the clip's.
    """
    name = document.path if document is not None else source.as_posix()
    source = absolute(source)
    findings = Findings(document, name)
    changed: tuple[ScenarioItem, ...] = clip_case.scenario.body
    for change in mutant.changes:
        before, changed = changed, changed_body(change, changed, findings, models=clip_case.models)
        if (softer := weakened(before, changed)) is not None:
            message = f"this makes '{softer}' easier to meet than in the clip, so that a failure would not show"
            findings.add(change, "now", WEAKENED, message, "leave the expectation as it is, or make it stricter")
    findings.raise_if_any()
    body: list[ScenarioItem] = [item for item in changed if not isinstance(item, UseNetwork | UseModels | Network)]
    at = sum(isinstance(item, Tags) for item in body)
    body[at:at] = surroundings(clip_case, source.parent)
    scenario = Scenario(name=mutant.name, body=tuple(body))
    return TestCase(
        id=name,
        scenario=scenario,
        network=clip_case.network,
        models=clip_case.models,
        meaning=meaning_hash(scenario, clip_case.network, clip_case.models),
        source=source,
        document=document,
        clip=clip_case.clip,
        mutant=mutant,
    )


def expanded_model(case: TestCase) -> Scenario:
    """Return a test case as one full scenario, with a network that is found from `case.source`'s folder."""
    body = case.scenario.body
    if any(isinstance(item, UseNetwork | Network) for item in body):
        return case.scenario
    at = sum(isinstance(item, Tags) for item in body)
    network = _network_of(case, case.source.parent)
    return Scenario(name=case.scenario.name, body=(*body[:at], network, *body[at:]))


def _essentials(clip: Clip, findings: Findings) -> tuple[Ego, Quantity]:
    """Return the ego and the window's length, or raise what is missing."""
    ego, window = _first(clip, Ego), _first(clip, Window)
    if ego is None:
        example = "write `ego: car.sedan at (0 m, 0 m) heading 0 deg speed 8 m/s { ... }`"
        findings.add(clip, "", INCOMPLETE_CLIP, f"clip '{clip.name}' has no ego", example)
    if window is None:
        findings.add(clip, "", INCOMPLETE_CLIP, f"clip '{clip.name}' has no window", "write `window 12.40 s..22.40 s`")
    length = _window_length(window, findings) if window is not None else None
    findings.raise_if_any()
    assert ego is not None and length is not None  # noqa: S101  (whatever is missing has just been raised)
    return ego, length


def _first(clip: Clip, kind: type[_T]) -> _T | None:
    return next((item for item in clip.body if isinstance(item, kind)), None)


def _window_length(window: Window, findings: Findings) -> Quantity | None:
    start, end = window.start, window.end
    if isinstance(start, Quantity) and isinstance(end, Quantity):
        if end.si > start.si:
            if start.unit == end.unit:  # exact, in the author's unit
                return Quantity(value=end.value - start.value, unit=end.unit)
            return Quantity.of(end.si - start.si, "time", 6)
        message = f"the window ends ({value_text(end)}) before it begins ({value_text(start)})"
        findings.add(window, "", EMPTY_WINDOW, message, "write the earlier time first")
    else:
        findings.add(window, "", EMPTY_WINDOW, "the window's times must be values; a clip has no parameters")
    return None


def _with_goal(ego: Ego, goal: Goal | None) -> Ego:
    if goal is None:
        return ego
    kept = tuple(item for item in ego.body if not isinstance(item, GoalAt))
    return ego.model_copy(update={"body": (*kept, GoalAt(place=goal.at))})


def surroundings(parent: TestCase, folder: Path) -> tuple[ScenarioItem, ...]:
    """Return the parent's network and catalogues as a file in `folder` names them."""
    items: list[ScenarioItem] = []
    for item in parent.scenario.body:
        if isinstance(item, UseNetwork | UseModels):
            there = absolute(parent.source.parent / item.path)
            items.append(item.model_copy(update={"path": relative_to(folder, there)}))
        elif isinstance(item, Network):
            items.append(item)
    if not any(isinstance(item, UseNetwork | Network) for item in items):
        items.insert(0, _network_of(parent, folder))
    return tuple(items)


def _network_of(case: TestCase, folder: Path) -> UseNetwork | Network:
    if isinstance(case.network, Network):
        return case.network.model_copy(update={"name": "here"})
    return UseNetwork(path=relative_to(folder, absolute(case.network)))


def _expectations(scenario: Scenario, actors: frozenset[str]) -> tuple[Expect, ...]:
    known = actors | {"ego"}
    gone = frozenset(actor.name for actor in scenario.actors) - known
    return tuple(
        expect
        for expect in scenario.all(Expect)
        if expect.mode != "eventually"
        and not mentioned(expect.condition) & gone
        and not _along_a_route(expect.condition)
    )


def _along_a_route(condition: Condition) -> bool:
    """Whether a place in it is counted along a route, which begins elsewhere in a clip."""
    return any(isinstance(part, Within) and isinstance(part.of, AlongRoute | PastJunction) for part in parts(condition))
