"""Pictures of scenes: what is in them and where, of every family of test cases, of children and of networks alone."""

from __future__ import annotations

import io
import re
import shutil
import subprocess
import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
import pytest
import shapely

from foresee_dsl.compile import compile_test_case
from foresee_dsl.compile.placement.checks import footprint
from foresee_dsl.errors import InputError
from foresee_dsl.language.meaning import pin_of
from foresee_dsl.language.project.loading import load_test_case
from foresee_dsl.report.drawing.ground import Layer, ground_of
from foresee_dsl.report.drawing.labels import LabelBox, Room
from foresee_dsl.report.drawing.palette import PAINTS
from foresee_dsl.report.drawing.svg import png_of_svg, svg_of
from foresee_dsl.report.picture.draw import Drawing, answer, draw
from foresee_dsl.report.picture.reading import read_subject
from tests.support.command import program

SVG = "{http://www.w3.org/2000/svg}"
CASES = (
    "scenario3.foresee::r01",
    "scenario3/behind_the_bus.foresee::commuter",
    "scenario3/over_the_median.foresee",
    "scenario4.foresee::r02",
    "scenario4/roundabout_exit.foresee",
    "scenario4/roadworks.foresee",
    "scenario7.foresee::r03",
    "scenario7/opposite_left.foresee",
    "scenario8.foresee::r01",
    "scenario8/turning_lane.foresee",
    "scenario9.foresee::r04",
    "scenario9/minor_road.foresee",
)
SMALL = """foresee 1

scenario small {
  doc "A <script>alert(1)</script> & more."
  network {
    junction a at (0 m, 0 m)
    junction b at (200 m, 0 m) signals {
      stage go for 25 s green [one, two]
      stage wait for 15 s green [three]
    }
    junction c at (400 m, 0 m)
    junction d at (200 m, 150 m)
    road one from a to b
    road two from b to c
    road three from d to b
    stop market on two at 40 m
  }
  ego: car.sedan {
    route from one straight over b
    start at 20 m along one
  }
  vehicle turner: car.compact {
    route from three left over b
    start at 30 m along three
  }
  when ego.eta(b) < 4 s { turner stops }
  when turner within 10 m of ego { turner changes speed to 3 m/s }
  when ego in junction b { turner stops }
  when time > 5 s { turner follows [(206 m, 30 m), (206 m, 10 m), (230 m, -1.65 m)] then joins [two] }
  expect never collision(ego)
  end after 20 s
  case near
}
"""


@pytest.fixture(scope="module")
def drawings(scenarios: Path) -> dict[str, Drawing]:
    return {case: draw(str(scenarios / case)) for case in CASES}


@pytest.fixture
def small(tmp_path: Path) -> Path:
    file = tmp_path / "small.foresee"
    file.write_text(SMALL, encoding="utf-8")
    return file


def parts(svg: str, kind: str) -> list[ET.Element]:
    root = ET.fromstring(svg)
    return [group for group in root.iter(f"{SVG}g") if kind in (group.get("class") or "").split()]


def test_every_actor_is_where_it_starts_and_knows_its_text(drawings: dict[str, Drawing], scenarios: Path) -> None:
    for address, drawing in drawings.items():
        frame = drawing.sheet.maps[0].frame
        case = load_test_case(str(scenarios / f"{address.partition('::')[0]}::{drawing.subject.case}"))
        placed = {actor.id: actor for actor in compile_test_case(case).scene.actors}
        named = [actor.name for actor in case.scenario.actors]
        bodies = {body.name: body for body in drawing.subject.bodies}
        assert set(bodies) == set(placed)
        groups = {
            group.get("data-name"): group for kind in ("body", "thing") for group in parts(svg_of(drawing.sheet), kind)
        }
        assert set(groups) == set(named), address
        for name in named:
            body, group = bodies[name], groups[name]
            assert np.allclose(body.corners, footprint(placed[name]))
            x, y = frame.point(*body.middle)
            assert 0 < x < frame.width and 0 < y < frame.height
            line = (
                Path(group.get("data-path") or "")
                .read_text(encoding="utf-8")
                .split("\n")[int(group.get("data-line") or 0) - 1]
            )
            assert line.lstrip().startswith(
                "ego:" if name == "ego" else ("vehicle", "bicycle", "pedestrian", "obstacle")
            )
            assert f"{name}:" in line
            assert any(name in (text.text or "") for text in group.iter(f"{SVG}text"))


def test_names_cover_neither_each_other_nor_the_bodies(drawings: dict[str, Drawing]) -> None:
    """Their boxes, as wide as the letters are on a phone; slanted names are tried in the browser."""
    covered = 0
    for drawing in drawings.values():
        boxes = []
        for part in drawing.sheet.maps[0].parts:
            for words in part.words:
                px = {"text": 13.0, "small": 11.5}[words.size] * 1.45
                width = 0.6 * px * len(words.text)
                left = {"start": words.x, "middle": words.x - width / 2, "end": words.x - width}[words.anchor]
                if not words.angle_deg:
                    boxes.append(LabelBox(left, words.y - px / 2, left + width, words.y + px / 2))
        covered += sum(a.touches(b) for k, a in enumerate(boxes) for b in boxes[:k])
        frame = drawing.sheet.maps[0].frame
        assert all(box.inside(LabelBox(-1, -1, frame.width + 1, frame.height + 1)) for box in boxes)
    assert covered <= 1


def test_what_a_small_scene_shows(small: Path) -> None:
    drawing = draw(str(small), width=600)
    subject = drawing.subject
    assert [zone.label for zone in subject.zones] == [
        "ego.eta(b) < 4 s",
        "turner within 10 m of ego",
        "ego in junction b",
    ]
    assert subject.cases == ("near",) and subject.case == "near"
    colours = sorted(head.colour for head in subject.heads)
    assert colours == ["green", "green", "red"]  # the first stage
    routes = {way.actor: way for way in subject.ways}
    # `< 4 s` at 50 km/h is 55.6 m before the junction
    line = subject.zones[0].outlines[0]
    entry = compile_test_case(load_test_case(f"{small}::near")).scene.ego.line
    assert entry is not None
    passage = entry.passage("b")
    assert passage is not None
    s, _ = entry.project(*line.mean(axis=0).tolist())
    assert passage.entry_s - s == pytest.approx(4 * 50 / 3.6, abs=0.5)
    assert routes["ego"].points[0] == pytest.approx(np.array((20.0, routes["ego"].points[0][1])), abs=3)
    svg = svg_of(drawing.sheet)
    assert "<script" not in svg and "&lt;script" in svg
    texts = " ".join("".join(text.itertext()) for text in ET.fromstring(svg).iter(f"{SVG}text"))
    later = [way for way in subject.ways if way.actor == "turner" and way.kind == "path"]
    assert [way.points.tolist() for way in later] == [[[206.0, 30.0], [206.0, 10.0], [230.0, -1.65]]]
    for word in ("stop market", "ego", "turner", "b: go", "one", "route", "trigger place"):
        assert word in texts
    junction = next(group for group in parts(svg, "junction") if (group[0].text or "") == "junction b")
    assert SMALL.split("\n")[int(junction.get("data-line") or 0) - 1].lstrip().startswith("junction b")


def test_long_networks_are_cropped(scenarios: Path) -> None:
    near = draw(str(scenarios / "scenario7.foresee::r03"))
    whole = draw(str(scenarios / "scenario7.foresee::r03"), whole=True)
    town = draw(str(scenarios / "networks" / "town.foresee"))
    assert near.sheet.maps[0].frame.scale > 3 * whole.sheet.maps[0].frame.scale
    assert whole.sheet.maps[0].frame.scale == pytest.approx(town.sheet.maps[0].frame.scale, rel=0.1)
    assert town.subject.bodies == () and len(parts(svg_of(town.sheet), "junction")) > 15


def test_the_picture_stands_still_while_an_actor_moves_by_a_metre(small: Path) -> None:
    texts = [SMALL.replace("start at 30 m along three", f"start at {metres} m along three") for metres in (30, 31, 32)]
    drawings = [draw(str(small), {small: text}) for text in texts]
    assert len({drawing.sheet.maps[0].frame for drawing in drawings}) == 1
    assert len({drawing.subject.bodies[1].middle for drawing in drawings}) == 3


def test_a_mutant_shows_what_changed_and_the_clip_what_it_was(small: Path) -> None:
    clip = small.with_name("small_p1.foresee")
    clip.write_text(
        f'foresee 1\n\nclip small_p1 of "small.foresee" case near pin {pin_of(load_test_case(f"{small}::near"))} {{\n'
        "  window 1.00 s..4.00 s\n"
        "  ego: car.sedan at (40.000 m, -1.650 m) heading 0.000 deg speed 11.000 m/s {\n    route [one, two]\n  }\n"
        "  goal (300.000 m, -1.650 m)\n"
        "  vehicle turner: car.compact at (198.350 m, 100.000 m) heading -90.000 deg speed 8.000 m/s {\n"
        "    route [three, two]\n    speed 8.000 m/s\n  }\n}\n",
        encoding="utf-8",
    )
    mutant = small.with_name("small_p1_m1.foresee")
    mutant.write_text(
        f'foresee 1\n\nmutant small_p1_m1 of "small_p1.foresee" pin {pin_of(load_test_case(clip))} {{\n'
        "  change turner.model: car.compact => bus.city\n}\n",
        encoding="utf-8",
    )
    plain, changed = draw(str(clip)), draw(str(mutant))
    assert plain.subject.changes == () and not parts(svg_of(plain.sheet), "before")
    assert changed.subject.changes == ("change turner.model: car.compact => bus.city",)
    turner = next(body for body in changed.subject.bodies if body.name == "turner")
    was = next(body for body in plain.subject.bodies if body.name == "turner")
    assert turner.before is not None and np.allclose(turner.before, was.corners)
    assert turner.text is not None and turner.text.path == mutant and turner.text.line == 4
    ego = next(body for body in changed.subject.bodies if body.name == "ego")
    assert ego.text is not None and ego.text.path == clip and ego.text.line == 5
    svg = svg_of(changed.sheet)
    assert parts(svg, "before") and "model car.compact =&gt; bus.city" in svg


def test_mistakes_have_their_place(small: Path) -> None:
    on_top = SMALL.replace("start at 30 m along three", "start at 20 m along one").replace(
        "route from three left", "route from one straight"
    )
    found = answer(small, {small: on_top}, width=600)
    (mistake,) = found["mistakes"]
    assert "on top of ego" in mistake["message"] and mistake["path"] == small.as_posix()
    (ring,) = parts(found["svg"], "mistake")
    assert ring.get("data-line") == str(mistake["line"])
    broken = answer(small, {small: SMALL.replace("vehicle turner", "vehicl turner")}, width=600)
    assert broken["svg"] is None
    assert (broken["mistakes"][0]["line"], broken["mistakes"][0]["column"]) == (
        SMALL[: SMALL.index("vehicle")].count("\n") + 1,
        3,
    )
    # a case that is gone is answered with the first
    assert answer(small, case="gone")["case"] == "near"


def test_the_command(small: Path, tmp_path: Path) -> None:
    pytest.importorskip("resvg_py", reason="resvg-py is not installed")
    command = [program(), "draw", "small.foresee::near", "--png", "a/b.png", "--svg", "c.svg"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "wrote c.svg\nwrote a/b.png\n")
    assert (tmp_path / "a" / "b.png").read_bytes().startswith(b"\x89PNG")
    ET.parse(tmp_path / "c.svg")
    bad = SMALL.replace("start at 30 m along three", "start at 900 m along three")
    small.write_text(bad, encoding="utf-8")
    done = subprocess.run(
        [program(), "draw", "small.foresee"], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert done.returncode == 1 and "wrote small_near.svg" in done.stderr and "small.foresee:" in done.stderr
    with pytest.raises(InputError, match="no picture"):
        draw(str(Path(__file__).parents[2] / "scenarios" / "models.foresee"))


def test_imported_networks(small: Path) -> None:
    net = small.with_name("street.net.xml")
    shutil.copyfile(compile_test_case(load_test_case(f"{small}::near")).net_file, net)
    drawing = draw(str(net))
    assert {name.text for name in drawing.subject.names} >= {"one", "two", "three", "b"}
    assert drawing.subject.files == (net,)


def test_a_label_takes_the_nearest_free_place() -> None:
    room = Room(LabelBox(0, 0, 100, 60))
    thing = LabelBox(40, 20, 50, 30)
    room.take(thing)
    first = room.beside(thing, 20, 10, insist=True)
    second = room.beside(thing, 20, 10, insist=True)
    assert first is not None and second is not None and not first.touches(second)
    assert first.left >= 50 and second.right <= 40
    room.take(LabelBox(0, 0, 100, 60))
    assert room.beside(thing, 20, 10, insist=False) is None
    assert room.beside(thing, 20, 10, insist=True) is not None


# ---- roundabouts, motorways, bus stops ------------------------------------------------------------------------------

RING = """foresee 1

scenario s {
  network n {
    junction west at (-130 m, 0 m)
    junction south at (0 m, -200 m)
    junction north at (0 m, 200 m)
    roundabout circle at (0 m, 0 m) { radius 90 m }
    road in from west to circle
    road out from circle to south
    road up from circle to north
  }
  ego: car.sedan {
    route [in, ..., out]
  }
  end after 20 s
}
"""


def test_a_roundabout_on_the_way_is_shown_whole(tmp_path: Path) -> None:
    (tmp_path / "s.foresee").write_text(RING)
    drawing = draw(str(tmp_path / "s.foresee"))
    (ring,) = drawing.subject.network.rings.values()
    left, bottom, right, top = drawing.sheet.maps[0].frame.bounds
    low, high = np.min(ring.polygon, axis=0), np.max(ring.polygon, axis=0)
    assert left <= low[0] and bottom <= low[1] and right >= high[0] and top >= high[1]


def test_a_motorway_has_shoulders_and_solid_lines_at_its_edges(root: Path) -> None:
    network = read_subject(str(root / "tests" / "compile" / "streets" / "motorway.foresee")).network
    ground = ground_of(network, lambda _points, _wide_m: True)
    carriageway_m, shoulder_m = 3 * 3.75, 2.5
    here = shapely.LineString([(-50, -40), (-50, 60)])  # across both directions
    across = here.intersection(ground[Layer.ROAD])
    assert across.length == pytest.approx(2 * (carriageway_m + shoulder_m), abs=0.3)
    assert len(shapely.get_parts(here.intersection(ground[Layer.EDGE_LINE]))) == 4  # both edges of both directions
    assert len(shapely.get_parts(here.intersection(ground[Layer.MARKING]))) == 4  # two lines between three lanes each


def test_a_street_in_a_town_has_no_edge_lines(root: Path) -> None:
    network = read_subject(str(root / "scenarios" / "networks" / "town.foresee")).network
    assert ground_of(network, lambda _points, _wide_m: True)[Layer.EDGE_LINE].is_empty


def test_bus_stops_are_drawn_where_buses_stand(tmp_path: Path) -> None:
    """Also behind a zebra crossing, which divides the road into edges of other names."""
    text = """foresee 1

network n {
  junction a at (0 m, 0 m)
  junction b at (190 m, 0 m)
  road r from a to b { sidewalk 2 m }
  zebra z on r at 60 m
  stop market on r at 120 m
  stop home on r_back at -20 m length 24 m
}
"""
    (tmp_path / "n.foresee").write_text(text)
    drawing = draw(str(tmp_path / "n.foresee"))
    stops = drawing.subject.network.stops
    assert set(stops) == {"market", "home"}
    long = {name: shapely.Polygon(stop.outline).bounds for name, stop in stops.items()}
    assert long["market"][2] == pytest.approx(120, abs=1) and long["market"][2] - long["market"][0] == pytest.approx(15)
    assert long["home"][0] == pytest.approx(20, abs=1) and long["home"][2] - long["home"][0] == pytest.approx(24)
    svg = svg_of(drawing.sheet)
    assert "p-bus_stop" in svg and ">bus stop<" in svg and ">stop market<" in svg


def test_a_bay_is_drawn_beside_the_lane_and_its_ends_have_no_names(tmp_path: Path) -> None:
    text = """foresee 1

network n {
  junction a at (0 m, 0 m)
  junction b at (200 m, 0 m)
  road r from a to b { sidewalk 2 m }
  stop market on r at 120 m length 20 m bay 3 m
}
"""
    (tmp_path / "n.foresee").write_text(text)
    drawing = draw(str(tmp_path / "n.foresee"))
    stop = shapely.Polygon(drawing.subject.network.stops["market"].outline)
    assert stop.bounds == pytest.approx((100, -6.3, 120, -3.3), abs=0.1)
    svg = svg_of(drawing.sheet)
    assert ">stop market<" in svg and "market_begin" not in svg and "market_end" not in svg


def test_the_png_has_the_colours_and_the_letters_of_the_svg(small: Path) -> None:
    image = pytest.importorskip("PIL.Image")
    pytest.importorskip("resvg_py", reason="resvg-py is not installed")
    sheet = draw(f"{small}::near").sheet
    for scheme, column in (("light", 0), ("dark", 2)):
        svg = svg_of(sheet, scheme=scheme)
        with_words = np.asarray(image.open(io.BytesIO(png_of_svg(svg))).convert("RGB")).astype(int)
        bare = np.asarray(image.open(io.BytesIO(png_of_svg(re.sub(r"<text.*?</text>", "", svg)))).convert("RGB"))
        assert with_words.shape[1] == 2 * round(sheet.width)
        for paint in ("paper", "grass", "road", "ego"):
            colour = [int(PAINTS[paint][column][k : k + 2], 16) for k in (1, 3, 5)]
            assert (with_words == colour).all(axis=2).sum() > 20, (scheme, paint)
        assert (with_words != bare).any(axis=2).sum() > 1000  # the names are there
