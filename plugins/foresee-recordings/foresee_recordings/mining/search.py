"""Searches a recording for situations: conditions and named ones, once each, with measures and sentences."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

import numpy as np

from foresee_dsl.simulate.trace import STEP_S
from foresee_recordings.mining import kernels
from foresee_recordings.mining.named import DEFAULT, situation_of
from foresee_recordings.mining.query import Query
from foresee_recordings.mining.situation import Occurrence, Situation
from foresee_recordings.mining.traffic import ACCELERATION, SPEED, Traffic

NEAR_M = 100.0
"""Actors whose centres never come nearer to the ego's are not compared with it, m. Ours: 2 s at 180 km/h."""
_SAME_S = 1.0
"""Situations of one kind, of the same actors, whose moments are less apart are one, s. Ours: a reaction time."""
_HOLDS = "the condition holds for {all} from {begins_s:.2f} s to {ends_s:.2f} s"
FIND = "find"
"""Name of the situations of a condition."""


def search(
    traffic: Traffic, conditions: Sequence[str] = (), names: Sequence[str] = (), *, within_m: float = NEAR_M
) -> tuple[Situation, ...]:
    """Return the situations in a recording, by time.

    Args:
        traffic: the recording. conditions: conditions of the language. names: names of situations; `DEFAULT`
            without conditions and names.
        within_m: actors that never come nearer to the ego than this are not compared with it, m.

    Raises:
        RecordingError: a condition or a name cannot be searched for.
    """
    queries = [Query.of(text) for text in conditions]
    chosen = [(name, situation_of(name)) for name in names or (() if conditions else DEFAULT)]
    situations: list[Situation] = []
    for number, query in enumerate(queries, 1):
        name = FIND if len(queries) == 1 else f"{FIND}_{number}"
        occurrences = _once(traffic, query.occurrences(traffic, within_m))
        situations += (situation(traffic, name, occurrence, _HOLDS) for occurrence in occurrences)
    for name, named in chosen:
        occurrences = _once(traffic, named.occurrences(traffic, within_m))
        situations += (situation(traffic, name, occurrence, named.words) for occurrence in occurrences)
    return tuple(sorted(situations, key=lambda s: (s.moment_s, s.name, s.ego, s.others)))


def most_critical(situations: Sequence[Situation], most: int) -> tuple[Situation, ...]:
    """Return the situations with the least time to collision or post-encroachment time, then distance; by time."""
    chosen = sorted(situations, key=_criticality)[:most]
    return tuple(sorted(chosen, key=lambda s: (s.moment_s, s.name, s.ego, s.others)))


def _criticality(situation: Situation) -> tuple[float, float]:
    measures = situation.measures
    soon_s = min(measures.get("ttc_s", math.inf), measures.get("pet_s", math.inf))
    return soon_s, measures.get("distance_m", math.inf)


def _once(traffic: Traffic, occurrences: Iterable[Occurrence]) -> list[Occurrence]:
    """Leave out occurrences of the same actors at the same time; of two egos, the faster one remains."""
    kept: list[Occurrence] = []
    by_actors: dict[frozenset[int], list[int]] = {}
    for occurrence in occurrences:
        places = by_actors.setdefault(frozenset((occurrence.ego, *occurrence.others)), [])
        same = next((k for k in places if _same(kept[k], occurrence)), None)
        if same is None:
            places.append(len(kept))
            kept.append(occurrence)
        elif _speed(traffic, occurrence) > _speed(traffic, kept[same]):
            kept[same] = occurrence
    return kept


def _same(a: Occurrence, b: Occurrence) -> bool:
    steps = _SAME_S / STEP_S
    return abs(a.moment - b.moment) < steps or (a.first <= b.last and b.first <= a.last)


def _speed(traffic: Traffic, occurrence: Occurrence) -> float:
    row = traffic.rows(occurrence.ego, np.array([occurrence.moment]))
    return float(traffic.states[row, SPEED][0])


def situation(traffic: Traffic, name: str, occurrence: Occurrence, words: str) -> Situation:
    """Return an occurrence with ids, times, measures and its sentence, which is made of `words` if it has none."""
    actors = (occurrence.ego, *occurrence.others)
    tracks = [traffic.tracks[k] for k in actors]
    called = [f"{track.kind} {track.id}" for track in tracks]
    measures = {**occurrence.measures, **_measures(traffic, occurrence)}
    begins_s, ends_s = traffic.time_s(occurrence.first), traffic.time_s(occurrence.last)
    fields = {"ego": called[0], "all": " and ".join(called), "begins_s": begins_s, "ends_s": ends_s, **measures}
    sentence = (occurrence.words or words).format(*called[1:], **fields)
    return Situation(
        name=name,
        ego=tracks[0].id,
        others=tuple(track.id for track in tracks[1:]),
        kinds=tuple(track.kind for track in tracks),
        begins_s=begins_s,
        ends_s=ends_s,
        moment_s=traffic.time_s(occurrence.moment),
        measures={key: value for key, value in measures.items() if math.isfinite(value)},
        sentence=sentence,
    )


def _measures(traffic: Traffic, occurrence: Occurrence) -> dict[str, float]:
    """Return the smallest distance and time to collision, the hardest braking, and the ego's speed at the moment."""
    frames = np.arange(occurrence.first, occurrence.last + 1)
    ego = traffic.rows(occurrence.ego, np.intersect1d(frames, _present(traffic, occurrence.ego)))
    measures = {"speed_mps": _speed(traffic, occurrence)}
    braking = -float(traffic.states[ego, ACCELERATION].min()) if len(ego) else 0.0
    if braking > 0:
        measures["braking_mps2"] = braking
    for other in occurrence.others:
        common = np.intersect1d(
            frames, np.intersect1d(_present(traffic, occurrence.ego), _present(traffic, other)), assume_unique=False
        )
        if not len(common):
            continue
        rows = traffic.rows(occurrence.ego, common), traffic.rows(other, common)
        for key, kernel in (("distance_m", kernels.gaps), ("ttc_s", kernels.times_to_touch)):
            out = np.empty(len(common))
            kernel(traffic.states, traffic.sizes, *rows, out)
            measures[key] = min(measures.get(key, math.inf), float(out.min()))
    return measures


def _present(traffic: Traffic, actor: int) -> np.ndarray[tuple[int], np.dtype[np.int64]]:
    return np.arange(traffic.first[actor], traffic.last[actor] + 1)
