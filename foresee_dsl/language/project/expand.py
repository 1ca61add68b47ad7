"""Expands clips and mutants to full scenarios, for `foresee expand`, the compiler and the simulation."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from foresee_dsl.files import absolute
from foresee_dsl.helps import write
from foresee_dsl.language import model as m
from foresee_dsl.language.document import Comments, Document, TestCase
from foresee_dsl.language.meaning import meaning_hash
from foresee_dsl.language.messages.collector import Collector
from foresee_dsl.language.messages.suggest import did_you_mean
from foresee_dsl.language.model.scenario import DEFAULT_END_S
from foresee_dsl.language.printer import print_model, remarked, value_text
from foresee_dsl.language.project.addresses import relative_to
from foresee_dsl.language.project.catalogues import check_models
from foresee_dsl.language.project.changes import changed_body, weakened
from foresee_dsl.language.project.concretise import concretise
from foresee_dsl.language.traversal import mentioned, parts


def expand_clip(clip: m.Clip, parent: TestCase, *, source: Path, document: Document | None = None) -> TestCase:
    """Return the full scenario of a clip that was cut from `parent`.

    Network, models, tracks, tags, weather and expectations are the parent's; all actors are the clip's. Three kinds of
    expectations are dropped: those with `eventually` (a window cannot judge them, because the event may have happened
    before it), those about actors that the clip does not have, and those about places along a route (which begins
    elsewhere in the clip).

    `source`: the clip's file (it need not exist yet); paths in the result are relative to its folder. `document` gives
    the errors their places, and the test case its document.
    """
    name = document.path if document is not None else source.as_posix()
    source = absolute(source)
    collector = Collector(document, name)
    ego, length = _essentials(clip, collector)
    actors = clip.all(m.Actor)
    body: tuple[m.ScenarioItem, ...] = (
        *parent.scenario.all(m.Tags),
        *surroundings(parent, source.parent),
        *parent.scenario.all(m.Weather),
        *clip.all(m.Slippery),
        _with_goal(ego, clip.first(m.Goal)),
        *actors,
        *clip.all(m.SignalState),
        *clip.all(m.When),
        *_expectations(parent.scenario, frozenset(actor.name for actor in actors)),
        m.End(after=length),
    )
    # A clip has no parameters, so this reports a bare name in the place of a value.
    scenario = concretise(m.Scenario(name=clip.name, body=body), None, document=document)
    check_models(scenario, parent.models, document, None)
    meaning = meaning_hash(scenario, parent.network, parent.models, parent.tracks)
    end = parent.scenario.first(m.End)
    return replace(
        parent, id=name, scenario=scenario, meaning=meaning, source=source, document=document, clip=clip, mutant=None,
        parent_ends_s=end.after.si if end is not None and isinstance(end.after, m.Quantity) else DEFAULT_END_S,
    )  # fmt: skip


def expand_mutant(
    mutant: m.Mutant, clip_case: TestCase, *, source: Path, document: Document | None = None, meaning: str = ""
) -> TestCase:
    """Return the full scenario of a mutant: the clip's, with every `change` line applied in order.

    A change of `steer`, `timing` or `delay` replaces the actor's present statement. `clip_case` may be another mutant.
    `source` and `document`: as for `expand_clip`. `meaning`: the test case's meaning, if the caller knows it.
    """
    name = document.path if document is not None else source.as_posix()
    source = absolute(source)
    collector = Collector(document, name)
    changed: tuple[m.ScenarioItem, ...] = clip_case.scenario.body
    for change in mutant.changes:
        before, changed = changed, changed_body(change, changed, collector, models=clip_case.models)
        if (softer := weakened(before, changed)) is not None:
            message = f"this makes '{softer}' easier to meet than in the clip, which would hide a failure"
            collector.add(change, "now", "FS311", message, "leave the expectation as it is, or make it stricter")
    _check_expected_actors(collector, mutant, clip_case.scenario)
    collector.raise_if_any()
    body = tuple(item for item in changed if not isinstance(item, m.UseNetwork | m.UseModels | m.UseTracks | m.Network))
    scenario = _behind_tags(mutant.name, body, *surroundings(clip_case, source.parent))
    meaning = meaning or meaning_hash(scenario, clip_case.network, clip_case.models, clip_case.tracks)
    goal = (mutant.origin.goal if mutant.origin else None) or clip_case.goal
    return replace(
        clip_case, id=name, scenario=scenario, meaning=meaning, source=source, document=document, mutant=mutant,
        goal=goal,
    )  # fmt: skip


def _check_expected_actors(collector: Collector, mutant: m.Mutant, clip: m.Scenario) -> None:
    """Report actors of expected results that are neither actors of the clip nor doors of such actors."""
    names = ["ego", *(actor.name for actor in clip.actors if actor.name != "ego")]
    doors = {m.door_name(name, side) for name in names for side in ("left", "right")}
    for item in mutant.body:
        if isinstance(item, m.Expected) and item.actor is not None and item.actor not in (*names, *doors):
            help = did_you_mean(item.actor, names)
            collector.add(
                item, "actor", "FS037", f"unknown actor '{item.actor}'", help or f"the clip has {', '.join(names)}"
            )


def expanded_model(case: TestCase) -> m.Scenario:
    """Return a test case as one full scenario, whose network's path is relative to the folder of `case.source`.

    A clip or mutant becomes a scenario that ends `anywhere`, because its ego need not arrive.
    """
    scenario = case.scenario
    if case.snapshot:
        ends = (i.model_copy(update={"where": "anywhere"}) if isinstance(i, m.End) else i for i in scenario.body)
        scenario = scenario.model_copy(update={"body": tuple(ends)})
    if any(isinstance(item, m.UseNetwork | m.Network) for item in scenario.body):
        return scenario
    return _behind_tags(scenario.name, scenario.body, _network_of(case, case.source.parent))


def expanded_text(case: TestCase) -> str:
    """Return a test case as the text of one full scenario; that of a clip or mutant begins with comments."""
    model = expanded_model(case)
    if case.clip is None:
        return print_model(model)
    kind, name = ("clip", case.clip.name) if case.mutant is None else ("mutant", case.mutant.name)
    lines = (
        f"The {kind} '{name}' as a full scenario. Its paths begin at the folder of the {kind}'s file.",
        *other_sensor_errors(case.clip, kind),
    )
    return print_model(model, {**remarked(model, {}), (): Comments(before=lines)})


def other_sensor_errors(clip: m.Clip, kind: str = "clip") -> tuple[str, ...]:
    """Return the comments which say that the full scenario of a clip, or of a mutant of it, has other sensor errors.

    The errors depend on the time: a clip has those of its seconds in the parent's run, a scenario those from 0 s on.
    """
    window = clip.first(m.Window)
    if window is None or not clip.start_s:
        return ()
    start = value_text(window.start)
    return (
        f"Sensor errors depend on the time: the {kind} has those of its parent's run from {start} on,",
        f"this scenario has those from 0 s on. So it may end in another way; `foresee run` of the {kind}'s own file",
        "repeats its run.",
    )


def _behind_tags(name: str, body: tuple[m.ScenarioItem, ...], *items: m.ScenarioItem) -> m.Scenario:
    at = sum(isinstance(item, m.Tags) for item in body)
    return m.Scenario(name=name, body=(*body[:at], *items, *body[at:]))


def _essentials(clip: m.Clip, collector: Collector) -> tuple[m.Ego, m.Quantity]:
    """Return the ego and the window's length; raise an error about what is missing."""
    ego, window = clip.first(m.Ego), clip.first(m.Window)
    ego_usage = "ego: car.sedan at (0 m, 0 m) heading 0 deg speed 8 m/s { ... }"
    for word, usage, item in (("ego", ego_usage, ego), ("window", "window 12.40 s..22.40 s", window)):
        if item is None:
            collector.add(clip, "", "FS044", f"clip '{clip.name}' has no {word}", "write " + write(usage))
    length = _window_length(window, collector) if window is not None else None
    collector.raise_if_any()
    assert ego is not None and length is not None  # noqa: S101  (`raise_if_any` raised if one is missing)
    return ego, length


def _window_length(window: m.Window, collector: Collector) -> m.Quantity | None:
    start, end = window.start, window.end
    if not (isinstance(start, m.Quantity) and isinstance(end, m.Quantity)):
        collector.add(window, "", "FS039", "the window's times must be values: a clip has no parameters")
    elif end.si <= start.si:
        message = f"the window ends ({value_text(end)}) before it begins ({value_text(start)})"
        help = "write the earlier time first"
        if end.si == start.si:
            message, help = f"the window ends when it begins ({value_text(start)})", "let it end later"
        collector.add(window, "", "FS039", message, help)
    elif start.unit == end.unit:  # exact, in the author's unit
        return m.Quantity(value=end.value - start.value, unit=end.unit)
    else:
        return m.Quantity.of(end.si - start.si, "time", 6)
    return None


def _with_goal(ego: m.Ego, goal: m.Goal | None) -> m.Ego:
    if goal is None:
        return ego
    others = tuple(item for item in ego.body if not isinstance(item, m.GoalAt))
    return ego.model_copy(update={"body": (*others, m.GoalAt(place=goal.at))})


def surroundings(parent: TestCase, folder: Path) -> tuple[m.ScenarioItem, ...]:
    """Return the statements by which a file in `folder` uses the parent's network, catalogues and tracks."""
    items: list[m.ScenarioItem] = []
    for item in parent.scenario.body:
        if isinstance(item, m.UseNetwork | m.UseModels | m.UseTracks):
            there = absolute(parent.source.parent / item.path)
            items.append(item.model_copy(update={"path": relative_to(folder, there)}))
        elif isinstance(item, m.Network):
            items.append(item)
    if not any(isinstance(item, m.UseNetwork | m.Network) for item in items):
        items.insert(0, _network_of(parent, folder))
    return tuple(items)


def _network_of(case: TestCase, folder: Path) -> m.UseNetwork | m.Network:
    if isinstance(case.network, m.Network):
        return case.network.model_copy(update={"name": "here"})
    return m.UseNetwork(path=relative_to(folder, absolute(case.network)))


def _expectations(scenario: m.Scenario, actors: frozenset[str]) -> tuple[m.Expect, ...]:
    gone = frozenset(actor.name for actor in scenario.actors) - actors - {"ego"}
    lasting = (expect for expect in scenario.all(m.Expect) if expect.mode != "eventually")
    return tuple(e for e in lasting if not mentioned(e.condition) & gone and not _along_a_route(e.condition))


def _along_a_route(condition: m.Condition) -> bool:
    """Return whether a condition has a place along a route, which begins elsewhere in a clip."""
    places = (part.of for part in parts(condition) if isinstance(part, m.Within))
    return any(isinstance(place, m.AlongRoute | m.PastJunction) for place in places)
