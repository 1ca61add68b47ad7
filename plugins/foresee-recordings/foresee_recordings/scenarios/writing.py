"""Writes situations of a recording as test cases: scenario, tracks, and one file of roads and one of models for all."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping, Sequence
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
_ON_TRACKS = ("pedestrian", "obstacle")
"""Classes that SUMO does not drive."""
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
        RecordingError: the recording has no roads that a test case can use, or an actor of `driven` is not in it or
            always follows its track.
    """
    if not situations:
        return ()
    tasks = []
    source = traffic.recording.source.name
    for number, (name, situation) in enumerate(zip(file_names(situations), situations, strict=True), 1):
        begins_s, ends_s = situation.moment_s - choice.before_s, situation.moment_s + choice.after_s
        cut = cut_around(traffic, traffic.ids[situation.ego], begins_s, ends_s, choice.radius_m)
        doc = f"Recorded: {situation.sentence}, at {situation.moment_s:.2f} s of {source}."
        tasks.append(_Task(number, name, doc, ("recorded", situation.name), cut))
    return _write(traffic, tasks, folder, choice)


def write_seconds(traffic: Traffic, ego: str, folder: Path, choice: Choice) -> WrittenCase:
    """Write all seconds of a recording in which an ego is there as a test case; errors as of `write_cases`."""
    recording = traffic.recording
    number = traffic.ids[recording.track(ego).id]
    cut = cut_around(traffic, number, recording.begins_s, recording.ends_s, choice.radius_m)
    doc = f"Recorded: {ego} from {cut.begins_s:.2f} s to {cut.ends_s:.2f} s of {recording.source.name}."
    task = _Task(0, word(f"{recording.name}_{ego}"), doc, ("recorded",), cut)
    (case,) = _write(traffic, [task], folder, choice)
    return case


@dataclass(frozen=True)
class _Draft:
    """A test case before the names of its files are chosen: its actors, the text of their tracks, and its notes."""

    task: _Task
    roles: list[Role]
    tracks: str
    notes: tuple[str, ...]


@dataclass(frozen=True)
class _Writer:
    """Writes the test cases of one recording into a folder; all of them share its roads and models."""

    traffic: Traffic
    roads: RecordedMap
    network: RoadNetwork
    models: Models
    folder: Path
    choice: Choice

    def shared(self) -> tuple[Files, dict[Path, str]]:
        """Return the names of the files of the roads and the models, which all drafts use, and their texts.

        Test cases that are there keep theirs: other roads or models get another name.
        """
        base, suffix = word(self.traffic.recording.name) or "recording", self.roads.suffix
        network, roads = free_name(base, lambda name: {self.folder / f"{name}{suffix}": self.roads.text})
        models, catalogue = free_name(
            base, lambda name: {self.folder / f"{name}.models.foresee": self.models.text(name)}
        )
        return Files(f"{network}{suffix}", f"{models}.models.foresee", "", ""), {**roads, **catalogue}

    def draft(self, task: _Task) -> _Draft | str:
        """Return the draft of a test case, or why there can be none."""
        cut = task.cut
        if reason := self._unusable(cut):
            return reason
        roles = _roles(self.traffic, cut, self.models, self.network, self.roads.offset, self.choice)
        goal = goal_before_the_end(self.traffic, cut, self.network, self.roads.offset)
        roles[0] = replace(roles[0], goal=goal)
        tables = {role.track_name: samples(role.track, cut.begins_s, cut.ends_s, self.roads.offset) for role in roles}
        notes = (*_notes(self.traffic, cut, self.network), *_not_driven(roles, self.choice))
        return _Draft(task, roles, tracks_text(self.traffic.recording, tables), notes)

    def case(self, draft: _Draft, shared: Files) -> tuple[WrittenCase, Mapping[Path, str]]:
        """Return the test case of a draft, and the texts of its scenario and tracks."""
        task = draft.task

        def files_of(name: str) -> dict[Path, str]:
            pin = hashlib.sha256(draft.tracks.encode()).hexdigest()[:_PIN_DIGITS]
            files = replace(shared, tracks=f"{name}.tracks.csv", pin=f"sha256:{pin}")
            model = scenario(
                name,
                task.doc,
                task.tags,
                files,
                draft.roles,
                lasts_s=task.cut.lasts_s,
                deviation_m=self.choice.deviation_m,
            )
            return {self.folder / files.tracks: draft.tracks, self.folder / f"{name}.foresee": print_model(model)}

        name, texts = free_name(task.name, files_of)
        renamed = f"{task.name}.foresee or its tracks are there with other content, so this one has another name"
        notes = draft.notes if name == task.name else (*draft.notes, renamed)
        file = self.folder / f"{name}.foresee"
        return WrittenCase(task.number, file, "", len(draft.roles) - 1, task.cut.left_out, notes), texts

    def _unusable(self, cut: Cut) -> str:
        ego = self.traffic.tracks[cut.ego]
        if ego.kind in EGO_KINDS and not route_of(_from(ego, cut.begins_s), self.network, self.roads.offset):
            return f"{ego.id} is on none of the map's lanes"
        return unusable(self.traffic, cut, self.network, self.roads.offset)


def _write(traffic: Traffic, tasks: Sequence[_Task], folder: Path, choice: Choice) -> tuple[WrittenCase, ...]:
    recording = traffic.recording
    roads = roads_of(recording)
    if roads is None:
        raise RecordingError(f"{recording.source.name} has no roads, and no vehicle in it moves; name a map with --map")
    for name in choice.driven:
        if (kind := recording.track(name).kind) in _ON_TRACKS:
            raise RecordingError(
                f"{name} is of the class {kind}, which always follows its track: leave out --drive {name}"
            )
    writer = _Writer(traffic, roads, network_of(roads), Models(), folder, choice)
    drafts = [writer.draft(task) for task in tasks]  # all of them before the first text: they share their models
    shared, texts = writer.shared()
    cases: list[WrittenCase] = []
    for task, draft in zip(tasks, drafts, strict=True):
        if isinstance(draft, str):
            cases.append(WrittenCase(task.number, None, draft, left_out=task.cut.left_out))
            continue
        case, files = writer.case(draft, shared)
        if recording.roads is None and not any(earlier.file for earlier in cases):  # about all, but said once
            case = replace(case, notes=(*case.notes, *roads.notes))
        cases.append(case)
        for path, text in (*texts.items(), *files.items()):
            write_whole(path, text)
        texts = {}  # written once
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
        wheels = track.kind not in _ON_TRACKS
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


def _not_driven(roles: Sequence[Role], choice: Choice) -> Iterator[str]:
    """Yield a note on each actor that SUMO should drive by the choice and does not; the first role is the ego."""
    for role in roles:
        id_ = role.track.id
        if id_ not in choice.driven or role.driven:
            continue
        if role is roles[0]:
            yield f"{id_} is the ego, which the tested driver drives: leave out --drive {id_}"
        elif not role.route:
            yield (
                f"{id_} is on none of the map's lanes, so SUMO cannot drive it and it follows its track: leave out "
                f"--drive {id_}, or name a map with its lanes with --map"
            )
        else:
            yield (
                f"{id_} is not there at the beginning, so SUMO cannot drive it from there and it follows its track: "
                f"leave out --drive {id_}, or begin later (a smaller --before; with --ego alone a later --from)"
            )


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
        notes.append(f"the recording has no possible sizes of {names}: they are usual ones of the class")
    return tuple(notes)
