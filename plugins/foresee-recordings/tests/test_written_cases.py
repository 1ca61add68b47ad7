"""Test cases made of a recording: the recorded drive passes, our drivers drive them, what is unusable is said."""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
from evaluation.replay import drive_as_recorded
from foresee_recordings.exporting.runs import recording_of
from foresee_recordings.maps.from_tracks import guessed_roads
from foresee_recordings.mining.search import search
from foresee_recordings.mining.traffic import Traffic
from foresee_recordings.recording import RecordedMap, Recording, RecordingError, Track
from foresee_recordings.scenarios.models_file import Models
from foresee_recordings.scenarios.tracks_file import samples
from foresee_recordings.scenarios.writing import Choice, write_cases, write_seconds

from foresee_dsl.campaign.driving import run_test_case
from foresee_dsl.compile import compile_test_case
from foresee_dsl.language.checked_files import check_paths
from foresee_dsl.language.project.loading import load_test_case
from foresee_dsl.simulate.results.verdict import Verdict
from foresee_dsl.simulate.trace import Trace

TEXT = """foresee 1

scenario recorded {
  use network "%s/networks/town.foresee"

  ego: car.sedan {
    route from mill_west straight over mill_oak straight over mill_elm
    start at 60 m along ego.route
    start speed 45 km/h
  }
  vehicle lead: car.compact {
    route from mill_west straight over mill_oak straight over mill_elm
    start at 30 m ahead of ego
    start speed 40 km/h
  }
  bicycle cyclist: bicycle.city {
    path [4 m ahead of ego offset 6 m, 40 m ahead of ego offset 6 m]
    start speed 5 m/s
  }
  pedestrian walker: pedestrian.adult {
    path [70 m ahead of ego offset -6 m, 70 m ahead of ego offset 9 m]
  }

  when time > 2 s { lead brakes 5 m/s^2 for 1.2 s }

  end after 8 s anywhere
}
"""


@dataclass(frozen=True)
class Recorded:
    """A run, and the same run as a recording with roads."""

    trace: Trace
    traffic: Traffic


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory, scenarios: Path) -> Recorded:
    file = tmp_path_factory.mktemp("recorded") / "recorded.foresee"
    file.write_text(TEXT % scenarios)
    case = load_test_case(str(file))
    trace = run_test_case(case, "idm", 0).trace
    roads = RecordedMap(compile_test_case(case).net_file.read_text(), ".net.xml")
    return Recorded(trace, Traffic(recording_of(trace, "town_run", roads)))


def moved(recording: Recording, actor: str, onto: str) -> Recording:
    """Return the recording with one actor at the places of another."""
    track = recording.track(onto)
    tracks = tuple(
        replace(t, time_s=track.time_s, states=track.states) if t.id == actor else t for t in recording.tracks
    )
    return replace(recording, tracks=tracks)


def test_a_recorded_drive_passes_and_is_the_recorded_one(recorded: Recorded, tmp_path: Path) -> None:
    case = write_seconds(recorded.traffic, "ego", tmp_path, Choice())
    assert case.file is not None and case.actors == 3 and case.left_out == 0
    assert check_paths([str(tmp_path)]).diagnostics == ()
    loaded = load_test_case(str(case.file))
    result = drive_as_recorded(loaded)
    assert result.verdict is Verdict.PASS, result.reason
    places = {info.id: k for k, info in enumerate(result.trace.actors)}
    frames = recorded.trace.frames
    for ours, theirs in (("ego", "ego"), ("vlead", "lead"), ("bcyclist", "cyclist"), ("pwalker", "walker")):
        there = recorded.trace.states[:frames, recorded.trace.index(theirs), :2]
        here = result.trace.states[:frames, places[ours], :2]
        off = np.hypot(*(here - there[: len(here)]).T)
        assert np.nanmax(off) < (0.6 if ours == "ego" else 0.02), ours  # the ego follows by steering and accelerating
    assert not any(event.what == "trigger" for event in result.trace.events)


@pytest.mark.parametrize("driver", ["pdm", "idm"])
def test_drivers_drive_mined_cases(recorded: Recorded, tmp_path: Path, driver: str) -> None:
    found = search(recorded.traffic, ["car.acceleration < -4 m/s^2 and distance(ego, car) < 60 m"])
    cases = write_cases(recorded.traffic, [s for s in found if s.ego == "ego"][:1], tmp_path, Choice(2.0, 4.0))
    (file,) = (case.file for case in cases)
    result = run_test_case(load_test_case(str(file)), driver, 0, rules="off")
    assert result.verdict is Verdict.PASS, result.reason


def test_who_drives_the_others_is_in_the_file(recorded: Recorded, tmp_path: Path) -> None:
    texts = {}
    for others in ("follow", "diverge", "drive"):
        case = write_seconds(recorded.traffic, "ego", tmp_path / others, Choice(others=others, deviation_m=1.5))
        assert case.file is not None
        assert check_paths([str(case.file)]).diagnostics == ()
        texts[others] = case.file.read_text()
    assert "joins" not in texts["follow"] and "deviation" not in texts["follow"]
    assert "when ego.deviation > 1.5 m {\n    vlead leaves track\n  }" in texts["diverge"]
    assert "start speed" in texts["drive"] and 'track "lead"' not in texts["drive"]
    assert 'pedestrian pwalker: pedestrian.r04x06 {\n    track "walker"\n  }' in texts["drive"]
    driven = write_seconds(recorded.traffic, "ego", tmp_path / "one", Choice(driven=frozenset({"lead"})))
    assert driven.file is not None and 'track "lead"' not in driven.file.read_text()


def test_who_cannot_be_driven_as_chosen_is_in_the_notes(recorded: Recorded, tmp_path: Path) -> None:
    recording = recorded.traffic.recording
    lead = recording.track("lead")
    aside = replace(lead, id="aside", states=lead.states + np.array([0.0, 500.0, 0.0, 0.0]))
    late = replace(lead, id="late", time_s=lead.time_s[60:], states=lead.states[60:] + np.array([0.0, 3.2, 0.0, 0.0]))
    traffic = Traffic(replace(recording, tracks=(*recording.tracks, aside, late)))
    driven = frozenset({"ego", "lead", "aside", "late"})
    case = write_seconds(traffic, "ego", tmp_path, Choice(radius_m=1000.0, driven=driven))
    assert case.file is not None and case.actors == 5
    notes = [note for note in case.notes if "--drive" in note]
    assert len(notes) == 3
    assert notes[0].startswith("ego is the ego, which the tested driver drives: leave out --drive ego")
    assert "aside is on none of the map's lanes, so SUMO cannot drive it" in notes[1] and "--map" in notes[1]
    assert "late is not there at the beginning" in notes[2] and "--drive late" in notes[2]
    text = case.file.read_text()
    assert 'track "aside"' in text and 'track "late"' in text and 'track "lead"' not in text


def test_times_that_round_to_one_are_one(recorded: Recorded) -> None:
    track = recorded.traffic.recording.track("lead")
    uneven = replace(track, time_s=track.time_s + 1e-7 * np.sin(np.arange(len(track.time_s))))
    times = samples(uneven, 0.05, 3.0000004, (0.0, 0.0))[:, 0]
    assert np.diff(times).min() > 0.0009 and times[0] == 0.0 and times[-1] == pytest.approx(2.95)


def test_recordings_share_a_folder(recorded: Recorded, tmp_path: Path) -> None:
    other = Traffic(replace(recorded.traffic.recording, sha256="f" * 64))
    files = [write_seconds(traffic, "ego", tmp_path, Choice()).file for traffic in (recorded.traffic, other) * 2]
    assert [file.name for file in files if file] == ["town_run_ego.foresee", "town_run_ego_2.foresee"] * 2
    assert write_cases(other, (), tmp_path, Choice()) == ()


def test_files_with_other_content_are_never_overwritten(recorded: Recorded, tmp_path: Path) -> None:
    recording = recorded.traffic.recording
    assert recording.roads is not None
    write_seconds(recorded.traffic, "ego", tmp_path, Choice())
    edited = tmp_path / "town_run_ego.foresee"
    edited.write_text(edited.read_text() + "# edited\n")
    before = {file.name: file.read_bytes() for file in tmp_path.iterdir()}
    roads = replace(recording.roads, text=recording.roads.text + "<!-- another -->\n")
    tracks = tuple(replace(track, length_m=track.length_m + 1) for track in recording.tracks)
    other = Traffic(replace(recording, sha256="f" * 64, roads=roads, tracks=tracks))
    names = ("2.net.xml", "2.models.foresee", "ego_2.foresee", "ego_2.tracks.csv")
    for _ in range(2):  # the same again is the same
        case = write_seconds(other, "ego", tmp_path, Choice())
        assert case.file == tmp_path / "town_run_ego_2.foresee" and "has another name" in case.notes[-1]
        text = case.file.read_text()
        assert '"town_run_2.net.xml"' in text and '"town_run_2.models.foresee"' in text
        new = {file.name for file in tmp_path.iterdir()} - before.keys()
        assert new == {f"town_run_{name}" for name in names}
    assert {name: (tmp_path / name).read_bytes() for name in before} == before
    assert check_paths([str(case.file)]).diagnostics == ()


def test_a_goal_before_the_end_of_the_map(tmp_path: Path) -> None:
    def driven(length_m: float) -> Track:
        x = np.arange(0.0, length_m + 0.1, 1.0)
        states = np.column_stack([x, np.zeros_like(x), np.zeros_like(x), np.full_like(x, 10.0)])
        return Track(f"to_{length_m:.0f}", "car", 4.6, 1.8, x / 10, states)

    roads = guessed_roads([driven(100.0)])  # they end 30 m after the track
    recording = Recording("straight", Path("straight.csv"), "0" * 64, "made", (driven(126.0),), roads=roads)
    case = write_seconds(Traffic(recording), "to_126", tmp_path, Choice())
    assert case.file is not None and roads is not None
    (goal,) = re.findall(r"goal \((\S+) m,", case.file.read_text())
    assert float(goal) - roads.offset[0] == pytest.approx(116.0, abs=0.6)
    assert drive_as_recorded(load_test_case(str(case.file))).verdict is Verdict.PASS


def test_strange_names_of_a_recording(recorded: Recorded, tmp_path: Path) -> None:
    strange = dict(zip(("ego", "lead", "cyclist", "walker"), ('a"b\n,c', "", "x" * 300, "\u202e7"), strict=True))
    recording = recorded.traffic.recording
    tracks = tuple(replace(track, id=strange[track.id]) for track in recording.tracks)
    source = Path('run "1"\n.csv')
    named = replace(recording, name='run "1"\n', source=source, tracks=tracks)
    case = write_seconds(Traffic(named), strange["ego"], tmp_path, Choice())
    assert case.file is not None
    assert check_paths([str(tmp_path)]).diagnostics == ()
    assert drive_as_recorded(load_test_case(str(case.file))).verdict is Verdict.PASS
    assert {path.name.isascii() for path in tmp_path.iterdir()} == {True}


def test_what_cannot_be_used_is_said(recorded: Recorded, tmp_path: Path) -> None:
    recording = recorded.traffic.recording
    crashed = write_seconds(Traffic(moved(recording, "lead", "ego")), "ego", tmp_path, Choice())
    assert crashed.file is None and "boxes of ego and lead overlap at 0.00 s" in crashed.reason
    walking = write_seconds(recorded.traffic, "walker", tmp_path, Choice())
    assert "a pedestrian, which a driver cannot drive" in walking.reason
    elsewhere = (
        replace(recording, roads=replace(recording.roads, offset=(5000.0, 0.0))) if recording.roads else recording
    )
    assert "on none of the map's lanes" in write_seconds(Traffic(elsewhere), "ego", tmp_path, Choice()).reason
    assert list(tmp_path.iterdir()) == []  # nothing is written
    with pytest.raises(RecordingError, match="--map"):
        alone = replace(recording, roads=None, tracks=(recording.track("walker"),))
        write_seconds(Traffic(alone), "walker", tmp_path, Choice())
    with pytest.raises(RecordingError, match="no actor 'nobody'"):
        write_seconds(recorded.traffic, "ego", tmp_path, Choice(driven=frozenset({"nobody"})))
    with pytest.raises(RecordingError, match=r"walker is of the class pedestrian, .* leave out --drive walker"):
        write_seconds(recorded.traffic, "ego", tmp_path, Choice(driven=frozenset({"walker"})))


def test_models_have_the_recorded_size(recorded: Recorded) -> None:
    models, track = Models(), recorded.traffic.recording.track("lead")
    names = [models.of(replace(track, length_m=length, width_m=1.83)) for length in (4.53, 4.46, 14.6)]
    assert names == ["car.r45x18", "car.r45x18", "car.r146x18"]
    assert models.text("sizes").count("\n  model ") == 2
