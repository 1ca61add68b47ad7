"""`foresee mine`: what it lists, prints as JSON, draws and refuses."""

from __future__ import annotations

import io
import re
from pathlib import Path

import pytest
from evaluation.planted import planted
from foresee_recordings.listing import print_situations
from foresee_recordings.mining.search import search
from foresee_recordings.mining.traffic import Traffic
from foresee_recordings.reading import Request, read
from rich.console import Console

from tests.support.first_project import checked, foresee


@pytest.fixture(scope="module")
def table(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A table with two cut-ins and two lane changes that are none."""
    recording, _ = planted("cut_in", each=2, seed=3)
    lines = ["time_s,actor,class,x_m,y_m,heading_rad,speed_mps,length_m,width_m"]
    for track in recording.tracks:
        for time_s, (x, y, heading, speed) in zip(track.time_s, track.states, strict=True):
            row = f"{time_s:.2f},{track.id},{track.kind},{x:.3f},{y:.3f},{heading:.4f},{speed:.3f}"
            lines.append(f"{row},{track.length_m},{track.width_m}")
    file = tmp_path_factory.mktemp("table") / "lanes.csv"
    file.write_text("\n".join(lines) + "\n")
    return file


def test_a_list_and_its_json(table: Path, tmp_path: Path) -> None:
    shown = foresee("mine", table, "--situation", "cut_in", "--pictures", tmp_path).stdout
    assert "lanes.csv: 16 actors" in shown
    assert len(re.findall(r"cuts in \d+\.\d m before car s\d_ego", shown)) == 2
    data = checked(foresee("mine", table, "--situation", "cut_in", "--find", "ego.speed > 90 m/s", "--json").stdout)
    assert data["document"] == "mine" and data["total"] == 2 and data["reader"] == "table"
    for situation in data["situations"]:
        assert situation["name"] == "cut_in" and set(situation["measures"]) >= {"gap_m", "headway_s", "distance_m"}
        assert situation["begins_s"] <= situation["moment_s"] <= situation["ends_s"]
    pictures = sorted(tmp_path.glob("*.svg"))
    assert len(pictures) == 2 and all("cut in at" in file.read_text() for file in pictures)


def test_conditions_and_egos(table: Path) -> None:
    condition = "distance(ego, other) < 60 m and other ahead of ego and ego.speed > 3 m/s"
    data = checked(foresee("mine", table, "--find", condition, "--ego", "s0_ego", "--top", "1", "--json").stdout)
    assert [s["ego"] for s in data["situations"]] == ["s0_ego"] and data["total"] >= 1
    assert "unprotected_left" in foresee("mine", "--list").stdout
    assert "no situations" in foresee("mine", table, "--find", "ttc(ego, pedestrian) < 2 s").stdout


def test_cases_of_a_recording_without_a_map(table: Path, tmp_path: Path) -> None:
    done = foresee("mine", table, "--situation", "cut_in", "--write", tmp_path, "--json")
    cases = checked(done.stdout)["cases"]
    assert [case["situation"] for case in cases] == [1, 2] and all(case["file"] for case in cases)
    assert any("guessed from the tracks" in note for note in cases[0]["notes"])
    foresee("check", tmp_path)


@pytest.mark.parametrize("columns", [80, 160])
def test_no_text_is_cut(table: Path, columns: int) -> None:
    found = search(Traffic(read(Request(table))))
    screen = Console(width=columns, record=True, file=io.StringIO())
    print_situations(screen, found, total=len(found))
    printed = screen.export_text()
    text = " ".join(printed.split())
    assert "…" not in text
    assert max(len(line) for line in printed.splitlines()) <= columns
    for situation in found:
        assert all(word in text for word in situation.sentence.split())


@pytest.mark.parametrize(
    ("options", "why"),
    [
        (("--find", "ttc(ego, other) < 2 m"), "compares a time with a length"),
        (("--find", "ego.signal(j4) is red"), "cannot be searched for"),
        (("--find", "a.speed > 3 m/s"), "about `ego`"),
        (("--find", "distance(ego, a) < 3 m and distance(b, c) < 3 m"), "at most 3 actors"),
        (("--situation", "cutting_in"), "there are cut_in"),
        (("--ego", "nobody"), "has no actor 'nobody'"),
        (("--reader", "nothing"), "nothing"),
    ],
)
def test_mistakes(table: Path, options: tuple[str, ...], why: str, tmp_path: Path) -> None:
    done = foresee("mine", table, *options, expect=1)
    assert why in str(done.exception)
    assert not (tmp_path / "mined").exists()


def test_no_situation_that_can_be_written_is_an_error(tmp_path: Path) -> None:
    lines = ["time_s,id,x_m,y_m,heading_rad,speed_mps,length_m,width_m"]
    for k in range(100):  # two cars side by side whose boxes overlap
        lines += [f"{k / 10},{n},{k},{n},0,10,4.5,1.8" for n in range(2)]
    file = tmp_path / "overlap.csv"
    file.write_text("\n".join(lines) + "\n")
    done = foresee("mine", file, "--find", "collision(ego)", "--write", tmp_path / "out", expect=1)
    assert "not written: no. 1" in done.stdout and "0 of 2 written" in done.stdout
    assert not (tmp_path / "out").exists()
