"""Tables: inD and highD, esmini's log, any CSV; what is guessed is said, and damaged files are errors with a line."""

from __future__ import annotations

import math
import re
from pathlib import Path

import numpy as np
import pytest
from foresee_recordings.readers.table import COLUMNS as TABLE_COLUMNS
from foresee_recordings.reading import Request, read
from foresee_recordings.recording import Recording, RecordingError

META = "recordingId,trackId,initialFrame,finalFrame,numFrames,width,length,class\n"
TRACKS = "recordingId,trackId,frame,xCenter,yCenter,heading,width,length,xVelocity,yVelocity\n"


def ind(folder: Path, tracks: str, meta: str, rate: str = "25") -> Path:
    """Write a recording with the columns of inD; return the table of tracks."""
    folder.mkdir(exist_ok=True)
    (folder / "07_recordingMeta.csv").write_text(f"recordingId,locationId,frameRate\n7,1,{rate}\n")
    (folder / "07_tracksMeta.csv").write_text(META + meta)
    (folder / "07_tracks.csv").write_text(TRACKS + tracks)
    return folder / "07_tracks.csv"


def rows(actor: int, count: int, x: float = 0.0, heading: float = 90.0, first: int = 0) -> str:
    return "".join(f"7,{actor},{first + k},{x},{0.4 * k},{heading},1.8,4.5,0,10\n" for k in range(count))


def test_ind_has_centres_headings_in_degrees_and_frames(tmp_path: Path) -> None:
    meta = "7,1,0,4,5,1.8,4.5,truck_bus\n7,2,0,4,5,0,0,pedestrian\n7,3,0,4,5,1,1,zeppelin\n"
    tracks = ind(tmp_path / "inD", rows(1, 5) + rows(2, 5, x=3) + rows(3, 5, x=6) + rows(9, 5, x=9), meta)
    recording = read(Request(tracks))
    truck, pedestrian = recording.tracks
    assert (truck.kind, truck.length_m, truck.width_m, truck.sized) == ("truck", 4.5, 1.8, True)
    assert truck.time_s == pytest.approx([0, 0.04, 0.08, 0.12, 0.16])
    assert truck.states[2] == pytest.approx([0.0, 0.8, math.pi / 2, 10.0])
    assert (pedestrian.kind, pedestrian.length_m, pedestrian.sized) == ("pedestrian", 0.4, False)
    assert recording.left_out == {"actors of an unknown class": 1, "actors that are not in tracksMeta": 1}
    assert recording.notes == ("Actors of kind pedestrian without a possible size have a usual one.",)
    folder = read(Request(tmp_path / "inD", numbers={"recording": 7}))
    assert (folder.name, folder.source, folder.sha256) == (
        "07_tracks".join(["recording_", ""]),
        tracks,
        recording.sha256,
    )


def test_highd_has_boxes_in_an_image_whose_y_points_down(tmp_path: Path) -> None:
    (tmp_path / "01_recordingMeta.csv").write_text("id,frameRate\n1,25\n")
    (tmp_path / "01_tracksMeta.csv").write_text(
        "id,width,height,class,drivingDirection\n1,5.0,2.0,Car,2\n2,15.0,2.5,Truck,1\n"
    )
    lines = "frame,id,x,y,width,height,xVelocity,yVelocity\n"
    for k in range(3):
        lines += f"{k},1,{10 + 1.2 * k},20,5.0,2.0,30,0.3\n{k},2,{400.0},8,15.0,2.5,0,0\n"
    (tmp_path / "01_tracks.csv").write_text(lines)
    car, truck = read(Request(tmp_path)).tracks
    assert (car.kind, car.length_m, car.width_m) == ("car", 5.0, 2.0)
    assert car.states[0] == pytest.approx([12.5, -21.0, math.atan2(-0.3, 30), math.hypot(30, 0.3)])
    assert truck.states[0] == pytest.approx([407.5, -9.25, -math.pi, 0.0]) and truck.kind == "truck"


def test_of_several_recordings_one_is_named(tmp_path: Path) -> None:
    ind(tmp_path, rows(1, 5), "7,1,0,4,5,1.8,4.5,car\n")
    for name in ("tracks", "tracksMeta", "recordingMeta"):
        (tmp_path / f"11_{name}.csv").write_bytes((tmp_path / f"07_{name}.csv").read_bytes())
    tables = r"its tables of tracks are 07_tracks.csv, 11_tracks.csv: write --number recording=7, for example"
    with pytest.raises(RecordingError, match=f"has more than one recording; {tables}"):
        read(Request(tmp_path))
    with pytest.raises(RecordingError, match=f"has no recording 5; {tables}"):
        read(Request(tmp_path, numbers={"recording": 5}))
    assert read(Request(tmp_path, numbers={"recording": 11})).source.name == "11_tracks.csv"


@pytest.mark.parametrize(
    ("tracks", "rate", "message"),
    [
        (rows(1, 3) + "7,1,3,4\n", "25", r"07_tracks.csv:5: the row has 4 values, but there are 10 columns"),
        (rows(1, 3) + "7,1,x,0,0,0,1,4,0,0\n", "25", r":5: a value is not a number \(could not convert .*'x'"),
        (rows(1, 3) + 'a,"' + "b" * 200_000, "25", r":\d+: not a row of a table \(field larger than field limit"),
        (rows(1, 3) + "7\0", "25", r":5: the line has a zero byte: not a text"),
        (rows(1, 3) + "é" * 10**6, "25", r":5: the line has more than 1,000,000 characters"),
        (rows(1, 3), "0", r"frameRate is '0', not a number above 0"),
        (rows(1, 3), "fast", r"frameRate is 'fast'"),
        ("", "25", r"it has no samples"),
    ],
)
def test_damaged_tables_are_errors_with_their_line(tmp_path: Path, tracks: str, rate: str, message: str) -> None:
    with pytest.raises(RecordingError, match=message):
        read(Request(ind(tmp_path, tracks, "7,1,0,4,5,1.8,4.5,car\n", rate)))


def test_missing_tables_and_texts_that_are_not_utf_8(tmp_path: Path) -> None:
    tracks = ind(tmp_path, rows(1, 5), "7,1,0,4,5,1.8,4.5,car\n")
    tracks.write_bytes(TRACKS.encode() + b"\xff\xfe,1\n")
    with pytest.raises(RecordingError, match="not a text in UTF-8"):
        read(Request(tracks))
    (tmp_path / "07_recordingMeta.csv").unlink()
    with pytest.raises(RecordingError, match=r"07_recordingMeta.csv cannot be read: No such file"):
        read(Request(tracks))


def table(tmp_path: Path, text: str, **wanted: object) -> Recording:
    file = tmp_path / "any.csv"
    file.write_text(text)
    return read(Request(file, **wanted))  # type: ignore[arg-type]


def test_a_table_with_usual_names_needs_no_map_of_columns(tmp_path: Path) -> None:
    text = "# a comment\nTimestamp_ms;Track ID;X;Y;yaw;vx;vy;Length;Width;Agent Type\n"
    text += "".join(f"{100 * k};a b;{k};{2 * k};116.565;10;20;4.2;1.7;cyclist\n" for k in range(4))
    recording = table(tmp_path, text)
    (track,) = recording.tracks
    assert (track.id, track.kind, track.length_m, track.sized) == ("a b", "bicycle", 4.2, True)
    assert track.time_s == pytest.approx([0, 0.1, 0.2, 0.3])
    assert track.states[1] == pytest.approx([1, 2, math.radians(116.565), math.hypot(10, 20)])
    assert recording.notes == ("Headings reach 117: they are in degrees.",)


def test_what_a_table_has_not_is_derived_and_said(tmp_path: Path) -> None:
    text = "n,who,east,north,sort\n" + "".join(f"{k},7,{max(k - 3, 0)},{5},blimp\n" for k in range(9))
    columns = {"frame": "n", "actor": "who", "x_m": "east", "y_m": "north", "kind": "sort"}
    recording = table(tmp_path, text, columns=columns, numbers={"rate_hz": 10.0})
    (track,) = recording.tracks
    assert track.kind == "car" and not track.sized
    assert track.states[:, 2] == pytest.approx(np.zeros(9))  # also before its first motion
    assert track.states[[0, 7], 3] == pytest.approx([0.0, 10.0])
    assert not recording.left_out and recording.notes[-2:] == (
        "1 actor has no headings: those of their motion are used.",
        "1 actor has no speeds: those of their positions are used.",
    )
    assert "1 actor has an unknown class ('blimp'): cars are assumed." in recording.notes


@pytest.mark.parametrize(
    ("columns", "numbers", "message"),
    [
        ({"x_m": "X"}, {}, r"has no column 'X'; its columns are n, who, east, north"),
        ({"width": "n"}, {}, r"there is no column 'width'; our names are time_s, "),
        ({"frame": "n"}, {}, r"like our actor and x_m and y_m: name it with --columns actor=NAME"),
        ({"frame": "n", "actor": "who", "x_m": "east", "y_m": "north"}, {}, "--number rate_hz=25"),
        ({"frame": "n", "actor": "who", "x_m": "east", "y_m": "north"}, {"rate_hz": 0.0}, "has frames and no times"),
    ],
)
def test_missing_columns_are_listed(
    tmp_path: Path, columns: dict[str, str], numbers: dict[str, float], message: str
) -> None:
    file = tmp_path / "any.csv"
    file.write_text("n,who,east,north\n1,a,0,0\n")
    with pytest.raises(RecordingError, match=message):
        read(Request(file, columns=columns, numbers=numbers), "table")


@pytest.mark.parametrize(("column", "ours"), [("t", "time_s"), ("id", "actor"), ("x", "x_m"), ("y", "y_m")])
def test_a_table_without_a_needed_column_is_recognised(tmp_path: Path, column: str, ours: str) -> None:
    text = driven(10).replace(f"{column},", "other,", 1)
    with pytest.raises(RecordingError, match=f"no column that is called like our {ours}: .* its columns are"):
        table(tmp_path, text)


def test_rows_may_come_in_any_order_and_kmh_are_noted(tmp_path: Path) -> None:
    steps = [f"{k / 10},a,{k},0,0,36\n" for k in range(100)]
    recording = table(tmp_path, "t,id,x,y,heading,speed\n" + "".join(steps[::-1]))
    assert recording.tracks[0].states[5, 0] == 5.0
    assert set(recording.notes) >= {
        "Samples of an actor are not in the order of their times, and were sorted.",
        "The positions move with 0.28 times the recorded speeds, which may be in another unit.",
    }
    kmh = table(tmp_path, "t,id,x,y,heading,v_kmh\n" + "".join(steps))
    assert kmh.tracks[0].states[0, 3] == 10.0 and len(kmh.notes) == 2


@pytest.mark.parametrize(("name", "used"), [("foo", "it uses rate_hz"), ("recording", "it uses rate_hz")])
def test_numbers_that_a_reader_does_not_use(tmp_path: Path, name: str, used: str) -> None:
    with pytest.raises(RecordingError, match=rf"the reader table does not use --number {name}: {used}"):
        table(tmp_path, driven(10), numbers={name: 50.0, "rate_hz": 10.0})


def driven(*speeds: float, heading: float = 0.0) -> str:
    """A table of actors that drive east with 10 m/s for 8 s; `speeds`: those that it has of them, m/s."""
    rows = [f"{k / 10},a{n},{k},{5 * n},{heading},{speed}\n" for n, speed in enumerate(speeds) for k in range(80)]
    return "t,id,x,y,heading_rad,speed\n" + "".join(rows)


@pytest.mark.parametrize("speed", [0.0, -10.0, 0.01])
def test_speeds_that_the_positions_contradict(tmp_path: Path, speed: float) -> None:
    why = (
        rf"positions of a0, a1 move, .* negative or near 0 \(a0: 10.0 m/s by its positions, {speed:.1f} m/s recorded\)"
    )
    with pytest.raises(RecordingError, match=why):
        table(tmp_path, driven(speed, speed))
    notes = table(tmp_path, driven(10, 10, speed)).notes
    assert any(note.startswith("The positions of a2 move, but") for note in notes)


def test_an_actor_with_speeds_in_another_unit_is_named(tmp_path: Path) -> None:
    notes = table(tmp_path, driven(10, 10, 36)).notes
    assert "The positions of a2 move with 0.28 times their recorded speeds, which may be in another unit." in notes


def test_units_of_a_recording_without_windows_of_a_second(tmp_path: Path) -> None:
    def short(per_s: float, speed: float) -> str:
        rows = [f"{k / 10 / per_s},a{n},{k},{5 * n},0,{speed}\n" for n in range(6) for k in range(10)]
        return "t,id,x,y,heading_rad,speed\n" + "".join(rows)

    with pytest.raises(RecordingError, match=r"move with 60 times the recorded speeds, so .* the times not in seconds"):
        table(tmp_path, short(60, 10))
    assert any("0.28 times the recorded speeds" in note for note in table(tmp_path, short(1, 36)).notes)


def test_a_vehicle_that_reverses_may_have_negative_speeds(tmp_path: Path) -> None:
    reverses = driven(-10, -10, heading=math.pi)
    assert not any("speeds" in note for note in table(tmp_path, reverses).notes)


@pytest.mark.parametrize("heading", [1.0, math.pi, -math.pi / 2])
def test_headings_that_the_motion_contradicts(tmp_path: Path, heading: float) -> None:
    with pytest.raises(
        RecordingError, match=r"headings of a0, a1 differ by \d+ degrees .* counter-clockwise from east"
    ):
        table(tmp_path, driven(10, 10, heading=heading))
    one, other = driven(10, 10, heading=heading).splitlines(), driven(10, 10).splitlines()
    mixed = table(tmp_path, "\n".join([*other[:81], *one[81:]]) + "\n")  # one of them may reverse
    assert any(note.startswith("The headings of a1 differ by") for note in mixed.notes)


def test_headings_of_many_turns_are_in_degrees(tmp_path: Path) -> None:
    text = driven(10, 10, heading=361.0)
    with pytest.raises(RecordingError, match=r"'heading_rad' reach 361, .* --columns heading_deg=heading_rad"):
        table(tmp_path, text)
    (track, _) = table(tmp_path, text, columns={"heading_deg": "heading_rad"}).tracks
    assert track.states[0, 2] == pytest.approx(math.radians(1))


def test_what_is_missing_in_some_samples(tmp_path: Path) -> None:
    lines = driven(10, 10).replace(",0.0,10", ",0.0,", 1).splitlines()
    sized = [
        f"{line},{size}"
        for line, size in zip(lines, ("length,width", *["99,1.8"] * 80, *["4.5,1.8"] * 80), strict=True)
    ]
    recording = table(tmp_path, "\n".join(sized) + "\n")
    assert recording.notes[:2] == (
        "2 actors have no class: cars are assumed.",
        "1 actor has no possible size: that which is usual for the class is used.",
    )
    assert "1 actor has no speeds in some samples: those of their positions are used." in recording.notes


@pytest.mark.parametrize("value", ["inf", "-inf", "nan", ""])
def test_motion_that_is_not_finite_is_derived(tmp_path: Path, value: str) -> None:
    text = "".join(line.replace(",0.0,10", f",{value},{value}") for line in driven(10, 10).splitlines(keepends=True))
    recording = table(tmp_path, text)
    assert recording.tracks[1].states[5, 2:] == pytest.approx([0.0, 10.0])
    assert "2 actors have no headings: those of their motion are used." in recording.notes


def test_headings_may_be_noisy_and_turn(tmp_path: Path) -> None:
    random = np.random.default_rng(1)
    rows = ["t,id,x,y,heading_rad,speed"]
    for n in range(4):  # turning at 0.4 rad/s with 4 m/s, at 25 Hz, blurred by 5 cm and 5 degrees
        for k in range(200):
            heading = 0.4 * k / 25 + n
            x, y = 10 * math.sin(heading) + random.normal(0, 0.05), -10 * math.cos(heading) + random.normal(0, 0.05)
            rows.append(f"{k / 25},a{n},{x + 50 * n},{y},{heading + random.normal(0, 0.09)},4")
    assert not any("differ" in note or "speeds" in note for note in table(tmp_path, "\n".join(rows) + "\n").notes)


def test_numbers_that_are_far_too_large_are_counted(tmp_path: Path) -> None:
    rows = [f"{k / 10},a,{k},0,0,{1e9 if k == 4 else 10}" for k in range(20)] + ["2,a,1e300,0,0,0", "1e200,a,0,0,0,0"]
    recording = table(tmp_path, "t,id,x,y,heading,speed\n" + "\n".join(rows) + "\n")
    assert recording.left_out == {
        "samples with a place or time that is far too large": 2,
        "speeds above 100 m/s, replaced by those of the positions": 1,
    }
    assert recording.tracks[0].states[4, 3] == pytest.approx(10.0)


NEW_LOG = """esmini GIT REV: 1
Scenario File Name: a.xosc
Number of Vehicles: 2
Index [-], TimeStamp [s], """
COLUMNS = ("Entity_Name [-]", "Entity_ID [-]", "Current_Speed [m/s]", "bb_x [m]", "bb_y [m]", "bb_length [m]",
           "bb_width [m]", "World_Position_X [m]", "World_Position_Y [m]", "World_Heading_Angle [rad]")  # fmt: skip


def esmini(columns: tuple[str, ...] = COLUMNS) -> str:
    names = ", ".join(f"#{k} {name}" for k in (1, 2) for name in columns)
    values = {
        1: "Ego, 0, 10, 1.4, 0.0, 5.0, 2.0, {x}, 3, 0.0",
        2: "Pedestrian 1, 1, 1.5, 0.1, 0, 0.6, 0.5, 30, {y}, 1.570796",
    }
    kept = [COLUMNS.index(name) for name in columns]
    text = NEW_LOG + names + ", \n"
    for k in range(5):
        cells = [values[n].format(x=k * 1.0, y=k * 0.15).split(", ") for n in (1, 2)]
        text += f"{k}, {k / 10}, " + ", ".join(cell[i] for cell in cells for i in kept) + ", \n"
    return text


def test_esminis_log_has_rear_axles_and_boxes(tmp_path: Path) -> None:
    file = tmp_path / "full_log.csv"
    file.write_text(esmini())
    recording = read(Request(file))
    ego, walker = recording.tracks
    assert recording.format == "esmini" and (ego.id, ego.kind, ego.length_m) == ("Ego", "car", 5.0)
    assert ego.states[2] == pytest.approx([3.4, 3.0, 0.0, 10.0])
    assert (walker.kind, walker.sized) == ("pedestrian", True)
    assert walker.states[0] == pytest.approx([30.0, 0.1, math.pi / 2, 1.5], abs=1e-5)


def test_an_old_log_of_esmini_has_no_boxes(tmp_path: Path) -> None:
    file = tmp_path / "old.csv"
    old = tuple(name for name in COLUMNS if not name.startswith("bb_"))
    file.write_text(esmini(old).replace("Entity_Name", "Entitity_Name") + "5, 0.5, Ego, 0\n")
    recording = read(Request(file))
    assert recording.track("Ego").states[0, 0] == 1.4 and not recording.track("Ego").sized
    assert recording.left_out == {"rows that are cut off": 1}
    assert any("1.4 m ahead of the rear axle" in note for note in recording.notes)
    file.write_text(esmini(old[:-1]))
    with pytest.raises(RecordingError, match="has no column #1 world_heading_angle, #2 world_heading_angle"):
        read(Request(file))


def test_the_guide_lists_the_columns_of_a_table() -> None:
    guide = (Path(__file__).parents[3] / "docs" / "guide" / "recordings.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\|.*\|$", guide.partition("| ours | needed |")[2].partition("\n\n")[0], re.MULTILINE)
    ours = {name for row in rows for name in re.findall(r"`(\w+)`", row.split("|")[1])}
    assert ours == set(TABLE_COLUMNS)
    usual = {name for row in rows for name in re.findall(r"`(\w+)`", row.split("|")[3].partition(". ")[0])}
    theirs = {name for names in TABLE_COLUMNS.values() for name in names} | {"car", "truck", "cyclist"}
    assert usual <= theirs
