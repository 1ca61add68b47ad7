"""Checks of a file that need no network: names, references, dimensions, missing and repeated statements."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import assert_never

from foresee_dsl.errors import Diagnostic, subject
from foresee_dsl.helps import HelpText, meant_code, one_of, remove, rename, write
from foresee_dsl.language import model as m
from foresee_dsl.language.checks.actors import check_actors
from foresee_dsl.language.checks.parameters import check_parameters, check_requirements
from foresee_dsl.language.checks.streets import NamedJunction, Ramp, Streets, check_touching
from foresee_dsl.language.checks.values import check_values
from foresee_dsl.language.document import Document
from foresee_dsl.language.messages.collector import Collector
from foresee_dsl.language.messages.suggest import did_you_mean
from foresee_dsl.language.model_classes import CLASSES
from foresee_dsl.language.printer import value_text, written
from foresee_dsl.language.streets.lines import xy
from foresee_dsl.language.streets.outlines import crosses_itself, fault_of, is_flat


def check_document(document: Document) -> tuple[Diagnostic, ...]:
    """Return every error that this file alone shows, in the order of the places."""
    collector = Collector(document)
    model = document.model
    match model:
        case m.Scenario():
            _check_scenario(collector, model)
            # The names of drawn cases are known only once they are drawn.
            drawn = any(isinstance(item, m.Cases) for item in model.body)
            _check_expected(collector, model, None if drawn else [case.name for case in model.all(m.Case)])
        case m.Clip():
            _check_clip(collector, model)
            _check_expected(collector, model, [])
        case m.Mutant():
            _check_mutant(collector, model)
            _check_expected(collector, model, [])
        case m.Extension():  # errors that show before it is joined with the scenario that it extends
            collector.only_once(model.all(m.Tags))
            _check_changes(collector, model.all(m.Change), parameters=True)
        case m.Network():
            check_network(collector, model)
        case m.Campaign():
            _check_campaign(collector, model)
        case m.Catalogue():
            check_catalogue(collector, model)
        case _:
            assert_never(model)
    if not isinstance(model, m.Extension):  # its values are checked once it is joined with the other scenario
        check_values(collector, model)
    return collector.sorted()


# ---- scenarios ------------------------------------------------------------------------------------------------------


def _check_scenario(collector: Collector, scenario: m.Scenario) -> None:
    egos, networks = scenario.all(m.Ego), (*scenario.all(m.UseNetwork), *scenario.all(m.Network))
    if not egos:
        example = "ego: car.sedan { route from south straight over j4 }"
        help = "add the vehicle that is driven by the software under test: " + write(example)
        collector.add(scenario, "name", "FS035", f"scenario '{scenario.name}' has no ego", help)
    if not networks:
        help = "add " + write('use network "town.foresee"') + " or a block `network { ... }`"
        collector.add(scenario, "name", "FS036", f"scenario '{scenario.name}' has no network", help)
    for what, code, items in (("ego", "FS035", egos), ("network", "FS036", networks)):
        for item in items[1:]:
            help = f"a scenario has exactly one {what}: " + remove("remove it")
            collector.add(item, "", code, f"this scenario has a second {what}", help, head_only=True)
    for kind in (m.End, m.Weather, m.Tags, m.UseTracks):
        collector.only_once(scenario.all(kind))
    if not scenario.all(m.UseTracks):
        for track in (item for actor in scenario.actors for item in actor.all(m.Track)):
            help = "add the file that holds it: " + write('use tracks "recorded.tracks.csv"')
            collector.add(track, "", "FS042", f"there is no file with the track '{track.name}'", help)
    for named, what in ((scenario.all(m.When), "triggers"), (scenario.all(m.Expect), "expectations")):
        collector.unique(named, what)
    collector.unique(scenario.all(m.Slippery), "slippery patches")
    _check_signals(collector, scenario.all(m.SignalState))
    for block in scenario.all(m.Network):
        check_network(collector, block)
    check_parameters(collector, scenario)
    check_requirements(collector, scenario)
    check_actors(collector, scenario)


def _check_expected(collector: Collector, model: m.Scenario | m.Clip | m.Mutant, cases: Sequence[str] | None) -> None:
    """Report a driver with two expected results, and a result for a case that does not exist; `cases` is None if they
    are unknown."""
    seen: set[tuple[str, str | None]] = set()
    for item in model.all(m.Expected):
        if (item.driver, item.case) in seen:
            collector.add(
                item, "driver", "FS013", f"'{item.driver}' has two expected results", remove("keep one of the two")
            )
        seen.add((item.driver, item.case))
        if item.case is not None and cases is not None and item.case not in cases:
            help = did_you_mean(item.case, cases) or "it has no cases: leave out " + write("in case")
            collector.add(item, "case", "FS100", f"there is no case '{item.case}'", help)


# ---- clips ----------------------------------------------------------------------------------------------------------


def _check_signals(collector: Collector, signals: Iterable[m.SignalState]) -> None:
    """Report a second state of one junction's signal."""
    stated: set[str] = set()
    for signal in signals:
        name = signal.junction.name if isinstance(signal.junction, m.Ref) else signal.junction
        if name in stated:
            collector.add(signal, "", "FS047", f"the signal of '{name}' is stated twice", remove("keep one of the two"))
        stated.add(name)


def _check_clip(collector: Collector, clip: m.Clip) -> None:
    needed: tuple[tuple[type[m.Item], str, str], ...] = (
        (m.Window, "window", "window 12.40 s..22.40 s"),
        (m.Ego, "ego", "ego: car.sedan at (1 m, 2 m) heading 90 deg speed 8 m/s { ... }"),
        (m.Goal, "goal", "goal (118.30 m, 40.10 m)"),
    )
    for kind, word, usage in needed:
        items = clip.all(kind)
        if not items:
            collector.add(clip, "name", "FS044", f"clip '{clip.name}' has no `{word}`", "write it like " + write(usage))
        collector.only_once(items)
    for item in clip.body:
        match item:
            case m.Window(start=m.Quantity() as start, end=m.Quantity() as end) if end.si == start.si:
                later = m.Quantity.of(end.si + 10.0, "time", 2)
                help = "let it end later, such as " + write(f"window {written(start)}..{written(later)}")
                collector.add(item, "", "FS039", "this window ends when it begins", help)
            case m.Window(start=m.Quantity() as start, end=m.Quantity() as end) if end.si < start.si:
                help = meant_code(f"window {written(end)}..{written(start)}")
                collector.add(item, "", "FS039", "this window ends before it begins", help)
            case m.Actor(state=None) if any(isinstance(part, m.Track) for part in item.body):
                pass  # its track gives its position
            case m.Ego(state=None) | m.Actor(state=None):
                help = "in a clip every actor has a state: " + write("at (1 m, 2 m) heading 90 deg speed 8 m/s")
                collector.add(item, "", "FS044", f"'{item.name}' has no position", help, head_only=True)
    collector.unique(clip.all(m.Slippery), "slippery patches")
    _check_signals(collector, clip.all(m.SignalState))
    check_actors(collector, clip)


# ---- mutants --------------------------------------------------------------------------------------------------------


def _check_mutant(collector: Collector, mutant: m.Mutant) -> None:
    if not mutant.changes:
        help = "add a line such as " + write("change runner.timing: 1.00 => 0.80")
        collector.add(mutant, "name", "FS045", f"mutant '{mutant.name}' changes nothing", help)
    collector.only_once(mutant.all(m.Origin))
    _check_changes(collector, mutant.changes, parameters=False)
    for change in mutant.changes:
        owner = m.OWNERS.get(change.actor)
        if owner is not None and owner.not_in_clips:
            others = " and ".join(f"`{name}`" for name, other in m.OWNERS.items() if not other.not_in_clips)
            message = f"a clip {owner.not_in_clips}, so a mutant cannot change it"
            collector.add(change, "property", "FS006", message, f"change a property of an actor, or {others}")


def _check_changes(collector: Collector, changes: Sequence[m.Change], *, parameters: bool) -> None:
    """Check `change` lines; with `parameters`, their values may be names of parameters."""
    seen: set[tuple[str, str]] = set()
    for change in changes:
        path = (change.actor, change.property)
        if path in seen:
            collector.add(
                change, "property", "FS013", f"'{'.'.join(path)}' is changed twice", remove("keep one of the two")
            )
        seen.add(path)
        for side in ("was", "now"):
            _check_changed(collector, change, side, parameters=parameters)
        rule = m.PROPERTIES.get(change.property)
        if change.actor in m.OWNERS or rule is None or not rule.timed:
            for field in ("start", "duration"):
                if getattr(change, field) is not None:
                    timed = write("steer") + ", " + write("line") + " and " + write("brakes")
                    help = timed + " have times, such as " + write("from 4.00 s for 1.00 s")
                    collector.add(change, field, "FS124", f"'{'.'.join(path)}' cannot have times", help)


def _check_changed(collector: Collector, change: m.Change, side: str, *, parameters: bool) -> None:
    value: m.ParamValue | m.Expression = getattr(change, side)
    if change.actor in m.OWNERS:
        needed = m.OWNERS[change.actor].dimension
    elif change.property == "model":
        if not isinstance(value, str):
            message = "the model of an actor must be the name of a model"
            collector.add(change, side, "FS046", message, "write one such as " + write("car.compact"))
        return
    else:
        rule = m.PROPERTIES.get(change.property)
        if rule is not None and rule.words and value not in rule.words:
            message = f"`{value_text(value)}` cannot be a value of `{change.property}`"
            collector.add(change, side, "FS046", message, f"write one of {', '.join(rule.words)}")
        needed = rule.dimension if rule is not None and not rule.words else None
    if needed is None:
        return  # any kind of value: it is compared with the clip's value when the files are joined
    if isinstance(value, str):
        if parameters:
            return  # the name of a parameter; if there is none, the joined scenario is refused
        help = "write " + collector.example(needed)
        collector.add(change, side, "FS046", f"`{value}` cannot be a value of `{change.property}`", help)
    elif isinstance(value, m.Quantity) and value.dimension != needed:
        collector.wrong_dimension(change, side, value, needed, code="FS046")


# ---- campaigns -------------------------------------------------------------------------------------------------------

_SEVERAL: tuple[type[m.Item], ...] = (m.Doc, m.Seeds)
"""Statements that a campaign may have several times; it may have every other statement only once."""


def _check_campaign(collector: Collector, campaign: m.Campaign) -> None:
    """Check a campaign's file. Whether its drivers, rankers and files exist is checked only when it runs."""
    if not campaign.all(m.Seeds):
        help = "name the test cases to run: " + write('seeds "scenarios/**"')
        collector.add(campaign, "name", "FS057", f"campaign '{campaign.name}' has no `seeds`", help)
    for kind in {type(item) for item in campaign.body} - set(_SEVERAL):
        collector.only_once(campaign.all(kind))
    for item in campaign.body:
        names = item.names if isinstance(item, m.Drivers | m.Against | m.Rankers) else ()
        for k, name in enumerate(names):
            if name in names[:k]:
                collector.add(item, f"names.{k}", "FS013", f"'{name}' is listed twice", remove("keep one of the two"))


def check_catalogue(collector: Collector, catalogue: m.Catalogue) -> None:
    """Check a catalogue of models."""
    models = catalogue.all(m.VehicleModel)
    collector.unique(models, "models")
    for model in models:
        class_ = model.name.partition(".")[0]
        if class_ not in CLASSES:
            help = did_you_mean(class_, CLASSES)
            collector.add(model, "name", "FS012", f"unknown class of models '{class_}'", help)
        _check_figures(collector, model)


def _check_figures(collector: Collector, model: m.VehicleModel) -> None:
    """Report numbers of a model that contradict each other, such as a cruise speed above the maximum speed."""
    for less, more in (("cruise_speed", "max_speed"), ("braking", "emergency_braking")):
        low, high = getattr(model, less), getattr(model, more)
        if isinstance(low, m.Quantity) and isinstance(high, m.Quantity) and low.si > high.si:
            message = f"its {less} `{written(low)}` is above its {more} `{written(high)}`"
            help: HelpText = "use at most " + write(written(high)) + ", or raise " + write(more)
            collector.add(model, less, "FS055", message, help)
    parts = {name: getattr(model, name) for name in ("front_overhang", "wheelbase", "rear_overhang")}
    lengths = {name: part for name, part in parts.items() if isinstance(part, m.Quantity)}
    if not lengths or not isinstance(model.length, m.Quantity):
        return
    sum_m, length_m = sum(part.si for part in lengths.values()), model.length.si
    over_m = sum_m - length_m
    if over_m > m.SUM_SLACK_M or (len(lengths) == len(parts) and over_m < -m.SUM_SLACK_M):
        message = f"{' + '.join(lengths)} is {sum_m:.2f} m, but the length is {length_m:.2f} m"
        last = next(reversed(lengths))
        left_m = length_m - (sum_m - lengths[last].si)
        help = "write " + write(f"{last} {left_m:.2f} m") if left_m > 0 else "correct these lengths, or `length`"
        collector.add(model, last, "FS055", message, help)


# ---- networks --------------------------------------------------------------------------------------------------------


def check_network(collector: Collector, network: m.Network) -> None:
    """Check a network, in a file of its own or inside a scenario."""
    junctions, roads = network.all(m.Junction), network.all(m.Road)
    collector.unique((item for item in network.body if isinstance(item, NamedJunction)), "junctions")
    collector.unique((item for item in network.body if isinstance(item, m.Road | Ramp)), "roads")
    collector.unique(network.all(m.Building), "buildings")
    collector.unique(network.all(m.BusStop), "stops")
    names = [item.name for item in network.body if isinstance(item, m.Junction | m.Roundabout)]
    for road in roads:
        _check_road(collector, road, names, {r.name for r in roads})
    for junction in junctions:
        _check_junction(collector, junction, network)
    for building in network.all(m.Building):
        _check_building(collector, building)
    if not roads:
        help = "add " + write(_first_road(network.all(m.Junction), names))
        collector.add(network, "name", "FS014", "this network has no roads", help)
    if len(junctions) + len(roads) + sum(isinstance(b, m.Building | m.Doc) for b in network.body) < len(network.body):
        Streets(collector, network, names).check()


def _first_road(junctions: Sequence[m.Junction], names: Sequence[str]) -> str:
    """Return the text of a road between two of these junctions, and of the junctions that it lacks."""
    ends = list(dict.fromkeys(names))[:2]
    east_m = [junction.at.x.si for junction in junctions if isinstance(junction.at.x, m.Quantity)]
    lines: list[str] = []
    for k in range(len(ends), 2):
        ends.append(next(name for name in ("a", "b") if name not in ends))
        lines.append(f"junction {ends[k]} at ({max(east_m, default=-100.0) + 100.0:g} m, 0 m)")
        east_m.append(max(east_m, default=-100.0) + 100.0)
    return "; ".join([*lines, f"road main from {ends[0]} to {ends[1]}"])


def _check_road(collector: Collector, road: m.Road, junctions: Sequence[str], roads: set[str]) -> None:
    for field, name, other in (("start", road.start, road.end), ("end", road.end, road.start)):
        if name not in junctions:
            help: HelpText = did_you_mean(name, [junction for junction in junctions if junction != other])
            collector.add(road, field, "FS040", "unknown junction '" + subject(name) + "'", help)
    others = [name for name in dict.fromkeys(junctions) if name != road.start]
    if road.start == road.end:
        add = "add " + write("junction b at (100 m, 0 m)")
        help = "let it end at one of " + one_of(others) if others else add
        collector.add(road, "end", "FS050", "this road ends where it begins", "a road joins two junctions; " + help)
    if road.name.removesuffix("_back") in roads - {road.name}:
        other = road.name.removesuffix("_back")
        message = f"'{road.name}' is also the other direction of road '{other}'"
        collector.add(road, "name", "FS030", message, rename("give it another name"))


def _check_building(collector: Collector, building: m.Building) -> None:
    """Report an outline that has no area or crosses itself; one with calculations is checked when it is built."""
    if not all(isinstance(value, m.Quantity) for point in building.outline for value in (point.x, point.y)):
        return
    outline = [xy(point) for point in building.outline]
    flat = is_flat(outline)
    if flat or crosses_itself(outline):
        message, help = fault_of(building.name, crosses=not flat)
        collector.add(building, "outline", "FS270", message, help)


def _check_junction(collector: Collector, junction: m.Junction, network: m.Network) -> None:
    collector.unique(junction.stages, f"stages of '{junction.name}'")
    if junction.control == "signals" and not junction.stages:
        roads = dict.fromkeys(road.name for road in network.all(m.Road) if junction.name in (road.start, road.end))
        help = "add at least one: " + write(f"stage go for 25 s green [{', '.join(roads) or 'north, south'}]")
        collector.add(junction, "name", "FS048", f"the signals of '{junction.name}' have no stages", help)
    if junction.control != "signals" and junction.stages:
        help = "write " + write("signals") + f" after the position of '{junction.name}', or " + remove("remove it")
        collector.add(
            junction.stages[0], "", "FS048", f"this stage is at '{junction.name}', which has no signals", help
        )
    named: list[tuple[m.Item, str, str]]
    named = [(junction, f"crossings.{k}", name) for k, name in enumerate(junction.crossings or ())]
    named += [(stage, f"green.{k}", name) for stage in junction.stages for k, name in enumerate(stage.green)]
    check_touching(collector, junction.name, named, network)
