"""Judges one OpenSCENARIO file: imports it, checks it, drives for nine seconds, and compares the run with the
player's."""

from __future__ import annotations

import dataclasses
import math
import tempfile
from dataclasses import dataclass
from pathlib import Path

from foresee_exchange.openscenario.losses import Losses, SourceError
from foresee_exchange.openscenario.reading import importer
from foresee_exchange.openscenario.reading.entities import Entity, read_participants
from foresee_exchange.openscenario.reading.source import Source, read_source

from corpus.player import play
from corpus.rows import Outcome, Row
from corpus.steady import SteadyDriver, steady_copy
from foresee_dsl.compile import compile_test_case
from foresee_dsl.errors import ForeseeError
from foresee_dsl.exchange.outcome import Imported
from foresee_dsl.language.document import TestCase
from foresee_dsl.language.model import End, Expect, Quantity, Scenario, When
from foresee_dsl.language.project.loading import load_test_cases
from foresee_dsl.language.traversal import all_actions
from foresee_dsl.simulate.runner import run
from foresee_dsl.simulate.trace import HEADING, Trace, X, Y

LOOKS_S = (1.0, 3.0, 6.0, 9.0)
"""Times at which actors are compared, s: the effect of a late trigger shows only at 6 and 9 s."""
NEAR_M = 3.0


@dataclass(frozen=True)
class Settings:
    """Common settings of all files: the player, and a folder of maps that files name without a path."""

    player: Path | None = None
    maps: Path | None = None


def judge(file: Path, name: str, settings: Settings) -> Row:
    """Return the result of one file; the caller must catch other exceptions than a refusal."""
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder)
        try:
            done = importer.run(file, out=out, road=settings.maps, allow_outside=True, partial=True)
        except ForeseeError as err:
            good = isinstance(err, SourceError)
            message = str(err).replace(str(file), "it").replace(str(out), "")
            return Row(name, Outcome.good_reason if good else Outcome.ours, message)
        lost = "; ".join(f"{count} {what}" for what, count in done.lost.items())
        row = Row(name, Outcome.partial if lost else Outcome.imported, lost)
        case, *_ = load_test_cases([file for file in done.files if file.name.endswith(f"{_scenario(done)}.foresee")])
        trace = run(compile_test_case(_shortened(case)), SteadyDriver(), deadlines=None).trace
        if settings.player is None or done.cases > 1:
            return row  # of a distribution only the player knows which set it plays
        source = read_source(file, allow_outside=True)
        source.elsewhere = settings.maps
        return _compared(row, source, case.scenario, trace, settings.player)


def _scenario(done: Imported) -> str:
    return next(f.name for f in done.files if not f.name.endswith("_models.foresee") and f.suffix == ".foresee")[:-8]


def _shortened(case: TestCase) -> TestCase:
    body = tuple(item for item in case.scenario.body if not isinstance(item, End | Expect))
    end = End(after=Quantity.of(LOOKS_S[-1] + 0.5, "time", 2))
    return dataclasses.replace(case, scenario=Scenario(name=case.scenario.name, body=(*body, end)))


def _by_the_ego(scenario: Scenario) -> set[str]:
    """Return the actors with orders relative to the ego, or to such an actor: their positions depend on the driver."""
    actions = [action for when in scenario.all(When) for action in all_actions(when.actions)]
    pairs = [(action.actor, getattr(action, "other", "")) for action in actions if hasattr(action, "actor")]
    actors = {"ego"}
    while more := {actor for actor, other in pairs if other in actors} - actors:
        actors |= more
    return actors - {"ego"}


def _compared(row: Row, source: Source, scenario: Scenario, trace: Trace, player: Path) -> Row:
    """Return the row with the distances between our actors and the player's, without the ego and actors that depend on
    it."""
    driven = _by_the_ego(scenario)
    entities = read_participants(source, Losses(), name="x").entities
    copy = steady_copy(source, next(ref for ref, entity in entities.items() if entity.name == "ego"), LOOKS_S[-1] + 1.0)
    try:
        played = play(player, copy, LOOKS_S)
    finally:
        copy.unlink()
    off: dict[str, tuple[float, float]] = {}
    for time_s, positions in played.at.items():
        for ref, entity in entities.items():
            ours = _reference_point(entity, trace, time_s)
            if entity.name != "ego" and entity.name not in driven and ref in positions and ours is not None:
                off[ref] = max(off.get(ref, (0.0, 0.0)), (math.dist(ours, positions[ref]), time_s))
    if not off:
        return dataclasses.replace(row, player_error=played.error)
    worst = max(off, key=lambda ref: off[ref])
    worst_m, when_s = off[worst]
    near = sum(away_m <= NEAR_M for away_m, _ in off.values())
    worst_actor = f"{worst} at {when_s:g} s"
    return dataclasses.replace(row, compared=len(off), near=near, worst_m=round(worst_m, 2), worst=worst_actor)


def _reference_point(entity: Entity, trace: Trace, time_s: float) -> tuple[float, float] | None:
    """Return the position of the entity's reference point in our run; None if it is not (or no longer) in the run."""
    names = [info.id for info in trace.actors]
    if entity.name not in names or trace.duration_s < time_s:
        return None
    state = trace.states[trace.frame_at(time_s), names.index(entity.name)]
    if math.isnan(state[X]):
        return None
    back = entity.centre_m
    return state[X] - back * math.cos(state[HEADING]), state[Y] - back * math.sin(state[HEADING])
