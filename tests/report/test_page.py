"""What `foresee show` prints: golden pages of one small run, plain text, at 80 and 160 columns."""

from __future__ import annotations

import base64
import io
import re
import unicodedata
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from foresee_dsl.compile import compile_test_case
from foresee_dsl.language.document import TestCase
from foresee_dsl.report.drawing.palette import PAINTS
from foresee_dsl.report.drawing.svg import png_of_svg
from foresee_dsl.report.show.measures import measure
from foresee_dsl.report.show.page import Page
from foresee_dsl.report.show.sources import ShownRun
from foresee_dsl.report.show.strip import svg_of
from foresee_dsl.report.show.terminal_pictures import Pictures, encoded, sixel, way_of
from foresee_dsl.simulate.runner import run
from foresee_dsl.simulate.trace import Trace
from tests.support.goldens import Golden
from tests.support.hidden_walker import hidden_walker
from tests.support.scenes import LaneKeeper

CASES = Path(__file__).parents[1] / "cases" / "report" / "show"


@pytest.fixture(scope="module")
def case(tmp_path_factory: pytest.TempPathFactory) -> TestCase:
    return hidden_walker(tmp_path_factory.mktemp("project"))


@pytest.fixture(scope="module")
def shown(case: TestCase) -> ShownRun:
    result = run(compile_test_case(case), LaneKeeper(10.0), meta={"driver": "keeper"})
    return ShownRun("hidden_walker.foresee", case, result.trace, "keeper", 0)


@pytest.fixture(scope="module")
def slower(case: TestCase) -> ShownRun:
    """The same with a driver that is slower: the parent, as it were."""
    result = run(compile_test_case(case), LaneKeeper(7.0), meta={"driver": "keeper"})
    return ShownRun("parent.foresee", case, result.trace, "keeper", 0)


@pytest.mark.parametrize("width", [80, 160])
def test_the_page_of_a_run(shown: ShownRun, width: int, golden: Golden) -> None:
    page = Page(shown, None)
    assert all(len(line.plain) <= width for line in page.lines(width, wrap=True))
    golden(_drawn(page, width), CASES / f"page_{width}.txt")


def test_parent_and_child_stand_side_by_side(shown: ShownRun, slower: ShownRun, golden: Golden) -> None:
    page = Page(shown, slower)
    golden(_drawn(page, 80), CASES / "beside_the_parent.txt")
    assert any("ego is" in line.plain and "faster" in line.plain for line in page.head(80, wrap=True))


def _drawn(page: Page, width: int) -> str:
    """Return timeline and strip, without the story (its words have tests of their own)."""
    return "".join(f"{line.plain.rstrip()}\n" for line in (*page.timeline(width), *page.pictures(width)))


def test_what_was_measured_is_what_happened(shown: ShownRun, case: TestCase) -> None:
    found = measure(shown.trace, compile_test_case(case), "walker")
    assert found.gap_m[-1] == 0.0
    assert (found.gap_m[:-1] > 0).all()
    assert found.ttc_s[-1] == 0.0
    assert not found.ego_sees[20:50].any(), "the van hides the walker"
    assert found.ego_sees[-1]
    assert found.other_sees[-1]


@pytest.mark.parametrize("name", ["\x1b[31mwalker\x1b[0m", "\u202ewalker", "<script>" * 100, "w" * 10_000])
def test_hostile_names_are_harmless(shown: ShownRun, name: str) -> None:
    trace = shown.trace
    actors = tuple(replace(a, id=name) if a.id == "walker" else a for a in trace.actors)
    events = tuple(replace(e, detail={**e.detail, "with": name}) if "with" in e.detail else e for e in trace.events)
    scene_name = replace(trace, actors=actors, events=events, meta={**trace.meta, "reason": f"hit {name}"})
    page = Page(replace(shown, address=name, trace=scene_name), None)
    for line in page.head(80, wrap=True):
        assert not [sign for sign in line.plain if unicodedata.category(sign) in ("Cc", "Cf")]


def test_a_shorter_parent_is_shown_as_far_as_it_goes(shown: ShownRun, slower: ShownRun) -> None:
    t = slower.trace
    cut = Trace(**{**{n: getattr(t, n) for n in Trace.__dataclass_fields__}, "time_s": t.time_s[:40],
                   "states": t.states[:40], "lanes": t.lanes[:40], "along": t.along[:40], "stages": t.stages[:40],
                   "elapsed": t.elapsed[:40]})  # fmt: skip
    text = "\n".join(line.plain for line in Page(shown, replace(slower, trace=cut)).lines(80, wrap=False))
    assert "in its parent" in text


# ---- pictures ------------------------------------------------------------------------------------------------------


def _image(shown: ShownRun) -> Any:
    image = pytest.importorskip("PIL.Image")
    pytest.importorskip("resvg_py", reason="resvg-py is not installed")
    return image.open(io.BytesIO(png_of_svg(svg_of(Page(shown, None).strips, ""))))


def test_the_png_shows_ego_and_opponent_in_their_colours(shown: ShownRun) -> None:
    picture = np.asarray(_image(shown).convert("RGB"))
    for role in ("ego", "opponent"):
        colour = [int(PAINTS[role].fill[k : k + 2], 16) for k in (1, 3, 5)]
        assert (picture == colour).all(axis=2).sum() > 50


def test_sixels_decode_to_the_picture() -> None:
    image = pytest.importorskip("PIL.Image")
    pixels = np.zeros((13, 20, 3), np.uint8)
    pixels[2:9, 3:15] = (255, 0, 0)
    pixels[9:, :] = (0, 0, 255)
    text = sixel(image.fromarray(pixels))
    assert np.array_equal(_decoded(text, 13, 20), pixels)


def test_the_opponent_is_red_in_sixels_too(shown: ShownRun) -> None:
    picture = _image(shown)
    found = _decoded(sixel(picture), picture.height, picture.width).astype(int)
    red = (found[..., 0] > 180) & (found[..., 1] < 90) & (found[..., 2] < 110)
    assert red.sum() > 50


def _decoded(text: str, rows: int, columns: int) -> np.ndarray:
    """Read sixels as a terminal does."""
    body = text.removeprefix(f'\x1bPq"1;1;{columns};{rows}').removesuffix("\x1b\\\n")
    colours: dict[int, tuple[int, int, int]] = {}
    found = np.zeros((rows + 6, columns, 3), np.uint8)
    x = y = colour = 0
    for token in re.finditer(r"#(\d+);2;(\d+);(\d+);(\d+)|#(\d+)|!(\d+)(.)|(\$)|(-)|([?-~])", body):
        new, r, g, b, use, count, sign, back, down, one = token.groups()
        if new:
            colours[int(new)] = tuple(round(int(part) * 255 / 100) for part in (r, g, b))  # type: ignore[assignment]
        elif use:
            colour = int(use)
        elif back:
            x = 0
        elif down:
            x, y = 0, y + 6
        else:
            bits, until = ord(sign or one) - 63, x + int(count or 1)
            for k in range(6):
                if bits >> k & 1:
                    found[y + k, x:until] = colours[colour]
            x = until
    return found[:rows]


def test_kitty_and_iterm_get_the_file_in_pieces() -> None:
    data = bytes(range(256)) * 40
    kitty = encoded(data, Pictures.KITTY)
    pieces = re.findall(r"\x1b_G([^;]*);([^\x1b]*)\x1b\\", kitty)
    assert base64.b64decode("".join(piece for _, piece in pieces)) == data
    assert all(len(piece) <= 4096 for _, piece in pieces)
    assert [keys.rpartition("m=")[2] for keys, _ in pieces] == ["1"] * (len(pieces) - 1) + ["0"]
    iterm = encoded(data, Pictures.ITERM)
    assert base64.b64decode(iterm.partition(":")[2].partition("\x07")[0]) == data


@pytest.mark.parametrize(
    ("environment", "way"),
    [
        ({"TERM": "xterm-kitty"}, Pictures.KITTY),
        ({"TERM": "xterm-256color", "KITTY_WINDOW_ID": "1"}, Pictures.KITTY),
        ({"TERM": "xterm-256color", "TERM_PROGRAM": "WezTerm"}, Pictures.KITTY),
        ({"TERM": "xterm-256color", "TERM_PROGRAM": "iTerm.app"}, Pictures.ITERM),
        ({"TERM": "foot"}, Pictures.SIXEL),
        ({"TERM": "xterm-256color"}, Pictures.AUTO),
        ({"TERM": "tmux-256color", "TMUX": "/tmp/x"}, Pictures.NONE),
        ({"TERM": "dumb"}, Pictures.NONE),
        ({}, Pictures.NONE),
    ],
)
def test_a_terminal_is_known_by_its_variables(environment: dict[str, str], way: Pictures) -> None:
    assert way_of(environment) is way
