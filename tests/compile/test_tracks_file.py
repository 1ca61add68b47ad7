"""The file of recorded tracks: what it may hold, and what is said about one that is wrong."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from foresee_dsl.compile import compile_test_case
from foresee_dsl.compile.tracks import TracksError, read_tracks
from foresee_dsl.errors import Diagnostic, InputError
from foresee_dsl.language.project.loading import load_test_case
from tests.support.recorded import HEAD, write_case


def read(folder: Path, content: str | bytes) -> object:
    file = folder / "some.tracks.csv"
    file.write_bytes(content if isinstance(content, bytes) else content.encode())
    return read_tracks(file)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("", "line 1 of some.tracks.csv: it is not `# foresee tracks 1`"),
        (HEAD.replace("tracks 1", "tracks 2"), "line 1 of some.tracks.csv: it is not `# foresee tracks 1`"),
        (HEAD.replace(",speed_mps", ""), "line 2 of some.tracks.csv: the columns are not .*: it is without speed_mps"),
        (HEAD.replace("x_m,y_m", "y_m,x_m"), "line 2 of .*: it is in another order, or with more columns"),
        ("# foresee tracks 1\n# no more\n", "line 2 of some.tracks.csv: the columns are not"),
        (HEAD + "0.00,7,1,2,3\n", "line 3 of some.tracks.csv: it has 5 values, not 6"),
        (HEAD + "0.00,7,1,2,3,4\n\n", "line 4 of some.tracks.csv: it has 1 values, not 6"),
        (HEAD + "0.00,7,here,2,3,4\n", "line 3 of some.tracks.csv: x_m is 'here', not a number"),
        (HEAD + "0.00,7,nan,2,3,4\n", "x_m is 'nan', not a number from -1e\\+07 to 1e\\+07"),
        (HEAD + "0.00,7,1,inf,3,4\n", "y_m is 'inf', not a number from"),
        (HEAD + "0.00,7,1,2,3,400\n", "speed_mps is '400', not a number from -150 to 150"),
        (HEAD + "-1.00,7,1,2,3,4\n", "time_s -1 is below 0"),
        (
            HEAD + "1.00,7,1,2,3,4\n0.50,8,1,2,3,4\n",
            "line 4 of .*: time_s 0.5 is earlier than that of the line before, 1",
        ),
        (HEAD + "1.00,7,1,2,3,4\n1.00,7,1,2,3,4\n", "line 4 of .*: actor '7' has a second line for time_s 1"),
        (HEAD + "0.00,,1,2,3,4\n", "the actor's name is empty"),
        (HEAD + '0.00,"7",1,2,3,4\n', "the actor's name is empty, or has quotes or invisible characters"),
        (HEAD + "0.00,7\u202e,1,2,3,4\n", "the actor's name is empty, or has quotes or invisible characters"),
        (HEAD.encode() + b"0.00,\xff,1,2,3,4\n", "line 3 of some.tracks.csv: it is not UTF-8"),
        (HEAD + "0.00,7,1,2,3,4\n" + "9" * 3_000_000, "line 4 of some.tracks.csv: it is longer than 1000 bytes"),
    ],
)
def test_a_wrong_file_is_refused_at_its_line(content: str | bytes, message: str, tmp_path: Path) -> None:
    with pytest.raises(TracksError, match=message):
        read(tmp_path, content)


def test_a_huge_file_is_not_read(tmp_path: Path) -> None:
    file = tmp_path / "huge.tracks.csv"
    with file.open("wb") as opened:
        opened.truncate(3_000_000_000)  # a hole, which takes no space on the disk
    with pytest.raises(TracksError, match="it has 3,000 MB, more than the 100 MB that are read; `foresee --limit file"):
        read_tracks(file)


def test_a_track_turns_the_shorter_way_and_stays_within_its_times(tmp_path: Path) -> None:
    rows = "0.10,7,0,0,170,4\n1.10,7,4,0,-170,4\n2.10,7,4,0,-170,0\n"
    track = read(tmp_path, HEAD + rows)["7"]  # type: ignore[index]
    assert math.degrees(abs(track.at(0.6).heading_rad)) == pytest.approx(180.0)
    assert (track.at(0.6).x, track.at(0.6).along_m) == (pytest.approx(2.0), pytest.approx(2.0))
    assert track.at(0.0) == track.at(0.1)
    assert track.at(9.9).x == 4.0
    assert [track.covers(t) for t in (0.0, 0.1, 2.1, 2.2)] == [False, True, True, False]
    assert track.way == ((0.0, 0.0), (4.0, 0.0))


def test_an_actor_that_never_moves_has_a_direction(tmp_path: Path) -> None:
    track = read(tmp_path, HEAD + "0.00,7,5,6,90,0\n9.00,7,5,6,90,0\n")["7"]  # type: ignore[index]
    (x, y), (to_x, to_y) = track.way
    assert (x, y, round(to_x, 9)) == (5.0, 6.0, 5.0)
    assert to_y > y


def errors(file: Path) -> tuple[Diagnostic, ...]:
    with pytest.raises(InputError) as raised:
        compile_test_case(load_test_case(file))
    return raised.value.diagnostics


def test_an_error_in_the_file_is_placed_at_the_statement_that_names_it(tmp_path: Path) -> None:
    file = write_case(tmp_path, rows=[(1.0, "117", 1.0, 2.0, 0.0, 1e6)])
    found = errors(file)
    assert [(d.code, d.span.line if d.span else 0) for d in found] == [("FS261", 9)]
    assert "line 3 of cut.tracks.csv: speed_mps is '1000000.000'" in found[0].message


def test_an_unknown_track_and_one_that_is_over(tmp_path: Path) -> None:
    file = write_case(tmp_path, more="delay 1 s")
    text = file.read_text(encoding="utf-8").replace('"p9"', '"p8"').replace('track "118"', 'track "118" from 9 s')
    file.write_text(text, encoding="utf-8")
    found = errors(file)
    assert [d.code for d in found] == ["FS261", "FS261"]
    assert found[0].message == "the track 118 ends at 8 s, so v118 would never be there"
    assert (found[1].message, found[1].help) == (
        "there is no track called p8",
        "write one of 112, 117, p9, parked, 118",
    )


def test_another_file_than_the_pinned_one(tmp_path: Path) -> None:
    file = write_case(tmp_path)
    tracks = tmp_path / "cut.tracks.csv"
    tracks.write_text(tracks.read_text(encoding="utf-8").replace("90.000", "91.000"), encoding="utf-8")
    (found,) = errors(file)
    assert found.code == "FS136"
    assert found.help.startswith("if the new tracks are meant, write `sha256:")
    file.write_text(file.read_text(encoding="utf-8").replace(found.names[1], found.names[0]), encoding="utf-8")
    assert load_test_case(file).tracks == tracks


def test_the_tracks_are_a_part_of_the_meaning(tmp_path: Path) -> None:
    before = load_test_case(write_case(tmp_path)).meaning
    rows = [(0.0, name, 10.0 * k, -1.65, 0.0, 0.0) for k, name in enumerate(("112", "117", "118", "p9", "parked"))]
    assert load_test_case(write_case(tmp_path, rows=rows)).meaning != before


@pytest.mark.parametrize(
    ("more", "message"),
    [
        ("route [main]", "'v117' follows its track, so it cannot have `route`"),
        ("start at (1 m, 2 m)", "'v117' follows its track, so it cannot have `start at`"),
        ("speed 9 m/s", "'v117' follows its track, so it cannot have `speed 9 m/s`"),
        ("path [(1 m, 2 m), (9 m, 2 m)]", "'v117' follows its track, so it cannot have `path`"),
        ("style creeps", "'v117' follows its track, so it cannot have `style creeps`"),
        ("line 0.5 m from 1 s for 2 s", "'v117' follows its track, so its `line` cannot have times"),
    ],
)
def test_what_a_track_decides_cannot_be_stated(more: str, message: str, tmp_path: Path) -> None:
    assert message in {d.message for d in errors(write_case(tmp_path, more=more))}
