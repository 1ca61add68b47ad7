"""Writes situations of a recording as test cases: scenario, tracks, and one file of roads and one of models for all."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from foresee_dsl.compile.roads.network import RoadNetwork
from foresee_dsl.files import write_whole
from foresee_dsl.language.printer import print_model
from foresee_recordings.maps.from_tracks import roads_of
from foresee_recordings.maps.matching import route_of
from foresee_recordings.mined import WrittenCase
from foresee_recordings.mining.roads import network_of
from foresee_recordings.mining.rows import EGO_KINDS
from foresee_recordings.mining.situation import Situation
from foresee_recordings.mining.traffic import Traffic
from foresee_recordings.recording import RecordedMap, RecordingError, Track
from foresee_recordings.scenarios.cut import Cut, cut_around, goal_before_the_end, overlapping_at_begin, unusable
from foresee_recordings.scenarios.models_file import Models
from foresee_recordings.scenarios.naming import file_names, free_name, unique, word
from foresee_recordings.scenarios.test_case import Files, Role, scenario
from foresee_recordings.scenarios.tracks_file import plain_name, samples, tracks_text

_PREFIX = {"pedestrian": "p", "bicycle": "b", "obstacle": "o"}
"""Beginnings of actors' names by class; `v` for vehicles."""
_PIN_DIGITS = 12


@dataclass(frozen=True)
class Choice:
    """What test cases contain.

    Attributes:
        before_s, after_s: seconds before and after the moment. radius_m: others that stay farther away are left out.
        others: `follow`, `drive` or `diverge`; see `foresee mine --help`. driven: ids of actors that SUMO drives.
        deviation_m: deviation of the ego at which others leave their tracks, m.
    """

    before_s: float = 4.0
    after_s: float = 6.0
    radius_m: float = 100.0
    others: str = "diverge"
    driven: frozenset[str] = frozenset()
    deviation_m: float = 2.0


@dataclass(frozen=True)
class _Task:
    """A test case to write: its name, what it shows, its tags, and its seconds."""

    number: int
    name: str
    doc: str
    tags: tuple[str, ...]
    cut: Cut


def write_cases(
    traffic: Traffic, situations: Sequence[Situation], folder: Path, choice: Choice
) -> tuple[WrittenCase, ...]:
    """Write a test case for each situation that can be one, and the files that they use.

    Raises:
        RecordingError: the recording has no roads that a test case can use, or an actor of `driven` is not in it.
    """
    if not situations:
        return ()
    tasks = []
    source = traffic.recording.source.name
    for number, (name, situation) in enumerate(zip(file_names(situations), situations, strict=True), 1):
        begins_s, ends_s = situation.moment_s - choice.before_s, situation.moment_s + choice.after_s
        cut = cut_around(traffic, traffic.ids[situation.ego], begins_s, ends_s, choice.radius_m)
        free = free_name(folder, name, traffic.recording.sha256)
        doc = f"Recorded: {situation.sentence}, at {situation.moment_s:.2f} s of {source}."
        tasks.append(_Task(number, free, doc, ("recorded", situation.name), cut))
    return _write(traffic, tasks, folder, choice)


def write_seconds(traffic: Traffic, ego: str, folder: Path, choice: Choice) -> WrittenCase:
    """Write all seconds of a recording in which an ego is there as a test case; errors as of `write_cases`."""
    recording = traffic.recording
    number = traffic.ids[recording.track(ego).id]
    cut = cut_around(traffic, number, recording.begins_s, recording.ends_s, choice.radius_m)
    doc = f"Recorded: {ego} from {cut.begins_s:.2f} s to {cut.ends_s:.2f} s of {recording.source.name}."
    name = free_name(folder, word(f"{recording.name}_{ego}"), recording.sha256)
    (case,) = _write(traffic, [_Task(0, name, doc, ("recorded",), cut)], folder, choice)
    return case


@dataclass(frozen=True)
class _Writer:
    """Writes the test cases of one recording into a folder; all of them share its roads and models."""

    traffic: Traffic
    roads: RecordedMap
    network: RoadNetwork
    models: Models
    folder: Path
    choice: Choice

    @property
    def base(self) -> str:
        """The name of the files that all test cases share."""
        return word(self.traffic.recording.name) or "recording"

    def shared(self) -> dict[Path, str]:
        """Return the files of the roads and the models."""
        return {
            self.folder / f"{self.base}{self.roads.suffix}": self.roads.text,
            self.folder / f"{self.base}.models.foresee": self.models.text(),
        }

    def case(self, task: _Task) -> tuple[WrittenCase, dict[Path, str]]:
        """Return a test case and its files; no files if it cannot be one."""
        cut = task.cut
        if reason := self._unusable(cut):
            return WrittenCase(task.number, None, reason, left_out=cut.left_out), {}
        roles = _roles(self.traffic, cut, self.models, self.network, self.roads.offset, self.choice)
        goal = goal_before_the_end(self.traffic, cut, self.network, self.roads.offset)
        roles[0] = replace(roles[0], goal=goal)
        tables = {role.track_name: samples(role.track, cut.begins_s, cut.ends_s, self.roads.offset) for role in roles}
        tracks = tracks_text(self.traffic.recording, tables)
        pin = hashlib.sha256(tracks.encode()).hexdigest()[:_PIN_DIGITS]
        files = Files(
            network=f"{self.base}{self.roads.suffix}",
            models=f"{self.base}.models.foresee",
            tracks=f"{task.name}.tracks.csv",
            pin=f"sha256:{pin}",
        )
        deviation_m = self.choice.deviation_m
        model = scenario(task.name, task.doc, task.tags, files, roles, lasts_s=cut.lasts_s, deviation_m=deviation_m)
        file = self.folder / f"{task.name}.foresee"
        notes = _notes(self.traffic, cut, self.network)
        case = WrittenCase(task.number, file, "", len(roles) - 1, cut.left_out, notes)
        return case, {self.folder / files.tracks: tracks, file: print_model(model)}

    def _unusable(self, cut: Cut) -> str:
        ego = self.traffic.tracks[cut.ego]
        if ego.kind in EGO_KINDS and not route_of(_from(ego, cut.begins_s), self.network, self.roads.offset):
            return f"{ego.id} is on none of the map's lanes"
        return unusable(self.traffic, cut, self.network, self.roads.offset)


def _write(traffic: Traffic, tasks: Iterable[_Task], folder: Path, choice: Choice) -> tuple[WrittenCase, ...]:
    recording = traffic.recording
    roads = roads_of(recording)
    if roads is None:
        raise RecordingError(f"{recording.source.name} has no roads, and no vehicle in it moves; name a map with --map")
    for name in choice.driven:
        recording.track(name)
    writer = _Writer(traffic, roads, network_of(roads), Models(word(recording.name) or "recording"), folder, choice)
    cases: list[WrittenCase] = []
    texts: dict[Path, str] = {}
    for task in tasks:
        case, files = writer.case(task)
        if files and not texts and recording.roads is None:  # about all test cases, but said once
            case = replace(case, notes=(*case.notes, *roads.notes))
        cases.append(case)
        texts |= files
    for path, text in (writer.shared() | texts if texts else texts).items():
        write_whole(path, text)
    return tuple(cases)


def _roles(
    traffic: Traffic,
    cut: Cut,
    models: Models,
    network: RoadNetwork,
    offset: tuple[float, float],
    choice: Choice,
) -> list[Role]:
    """Return the roles of the ego and of the others."""
    numbers = (cut.ego, *cut.others)
    names = unique(_name(traffic.tracks[k], k) for k in numbers)
    track_names = unique(plain_name(traffic.tracks[k], k) for k in numbers)
    roles = []
    for k, name, track_name in zip(numbers, names, track_names, strict=True):
        track = traffic.tracks[k]
        wheels = track.kind not in ("pedestrian", "obstacle")
        later = _from(track, cut.begins_s)
        route = route_of(later, network, offset) if wheels else ()
        role = Role(name, track, track_name, models.of(track), route)
        if k != cut.ego:
            role = _as_chosen(role, cut, offset, choice)
        roles.append(role)
    return roles


def _as_chosen(role: Role, cut: Cut, offset: tuple[float, float], choice: Choice) -> Role:
    """Return another actor's role, with who drives it."""
    if choice.others == "follow" and role.track.id not in choice.driven:
        return replace(role, route=())
    state = role.track.at(cut.begins_s)
    if role.route and state is not None and (choice.others == "drive" or role.track.id in choice.driven):
        x, y, heading, speed = (float(value) for value in state)
        return replace(role, driven=True, state=(x + offset[0], y + offset[1], heading, max(speed, 0.0)))
    return replace(role, leaves=bool(role.route))


def _from(track: Track, begins_s: float) -> Track:
    """Return the part of a track from a time on."""
    later = track.time_s >= begins_s
    if later.sum() < 2:
        return track
    return replace(track, time_s=track.time_s[later], states=track.states[later])


def _name(track: Track, number: int) -> str:
    return f"{_PREFIX.get(track.kind, 'v')}{word(track.id) or number}"


def _notes(traffic: Traffic, cut: Cut, network: RoadNetwork) -> tuple[str, ...]:
    notes = []
    if any(movement.tls is not None for movement in network.movements):
        notes.append("signals follow the map's program, whatever they showed in the recording")
    for a, b in overlapping_at_begin(traffic, cut):
        notes.append(
            f"the recorded boxes of {traffic.tracks[a].id} and {traffic.tracks[b].id} overlap at the beginning"
        )
    guessed = [traffic.tracks[k].id for k in (cut.ego, *cut.others) if not traffic.tracks[k].sized]
    if guessed:
        names = ", ".join(guessed[:5]) + (f" and {len(guessed) - 5} more" if len(guessed) > 5 else "")
        notes.append(f"the recording has no sizes of {names}: they are usual ones of the class")
    return tuple(notes)
