"""Mistakes in a network's statements that show only when it is built: they have a place, and hide no other file."""

import random
from pathlib import Path

import pytest
import shapely

from foresee_dsl.compile import compile_test_case, with_placements
from foresee_dsl.compile.nets import netconvert, network_builder
from foresee_dsl.errors import Diagnostic, InputError
from foresee_dsl.language.checked_files import check_paths
from foresee_dsl.language.project.loading import load_test_case
from foresee_dsl.language.streets.outlines import crosses_itself, is_flat
from foresee_dsl.report.picture.reading import read_subject

STREETS = """
  junction m at (0 m, 0 m)
  junction w at (-200 m, 0 m)
  junction e at (200 m, 0 m)
  road west from w to m {{ lanes 2; sidewalk 2 m }}
  road east from m to e {{ lanes 2; sidewalk 2 m }}
  {0}
"""
BANK = "building bank [(10 m, -10 m), (30 m, -10 m), (30 m, 3 m), (10 m, 3 m)]"
DRIVE = """foresee 1

scenario drive {{
  {0}
  param gap: length = 40 m
  case near {{ gap = 20 m }}
  case far {{ gap = 60 m }}
  ego: car.sedan {{
    route [west, east]
    start at gap along ego.route
  }}
  vehicle lead: car.compact {{
    route [{1}]
    start at 90 m along lead.route
  }}
  expect never collision(ego)
  end after 20 s
}}
"""


def network(statement: str) -> str:
    return "foresee 1\n\nnetwork town {" + STREETS.format(statement) + "}\n"


def found() -> tuple[Diagnostic, ...]:
    result = check_paths(["."])
    return tuple(d for d in with_placements(result.diagnostics, result.cases) if d.severity == "error")


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_other_files_are_checked_too(here: Path, monkeypatch: pytest.MonkeyPatch):
    (here / "bad.foresee").write_text(network(BANK))
    (here / "good.foresee").write_text(network(""))
    (here / "a.foresee").write_text(DRIVE.format('use network "bad.foresee"', "west, east"))
    (here / "b.foresee").write_text(DRIVE.format('use network "bad.foresee"', "west, east"))
    (here / "c.foresee").write_text(DRIVE.format('use network "good.foresee"', "west, nowhere"))
    runs: list[Path] = []

    def counted(arguments: list[str], folder: Path) -> None:
        runs.append(folder)
        netconvert.run_netconvert(arguments, folder)

    monkeypatch.setattr(network_builder, "run_netconvert", counted)
    assert [(d.path, d.code, d.span and d.span.line) for d in found()] == [
        ("bad.foresee", "FS270", 9),
        ("c.foresee", "FS250", 13),
    ]
    assert len(runs) == 2  # each network is built once, although four test cases use the one with the mistake


def test_the_place_is_in_the_file_that_holds_the_network(here: Path):
    """A network within a scenario, and one whose statements are replaced because of a calculation."""
    (here / "within.foresee").write_text(DRIVE.format("network {" + STREETS.format(BANK) + "}", "west, east"))
    (mistake,) = found()
    assert (mistake.path, mistake.source_line.strip()) == ("within.foresee", BANK)
    (here / "town.foresee").write_text(network(BANK.replace("30 m, 3 m", "3 * 10 m, 3 m")))
    (here / "within.foresee").write_text(DRIVE.format('use network "town.foresee"', "west, east"))
    (mistake,) = found()
    assert (mistake.path, mistake.span and mistake.span.line) == ("town.foresee", 9)
    with pytest.raises(InputError, match=r"town\.foresee:9:.*FS270 building 'bank' stands on road 'east'"):
        compile_test_case(load_test_case("within.foresee::near"))


@pytest.mark.parametrize("address", ["town.foresee", "drive.foresee"])
def test_a_picture_names_the_place(here: Path, address: str):
    (here / "town.foresee").write_text(network(BANK))
    (here / "drive.foresee").write_text(DRIVE.format('use network "town.foresee"', "west, east"))
    with pytest.raises(InputError, match=r"town\.foresee:9:.*FS270"):
        read_subject(address)


@pytest.mark.parametrize(
    ("statement", "words"),
    [
        ("lane 1 of west_back goes [left]", "no way leads left from 'west_back' over 'w'"),
        ("lane 1 of west goes [left]", "no way leads left from 'west' over 'm'"),
        ("forbid left over e from [east]", "no way leads left from 'east' over 'e' anyway"),
    ],
)
def test_turns_that_no_road_has(here: Path, statement: str, words: str):
    (here / "town.foresee").write_text(network(statement))
    (here / "drive.foresee").write_text(DRIVE.format('use network "town.foresee"', "west, east"))
    (mistake,) = found()
    assert (mistake.path, mistake.code, mistake.source_line.strip()) == ("town.foresee", "FS270", statement)
    assert words in mistake.message


def test_outlines_are_judged_like_those_of_the_built_network():
    rng = random.Random(0)
    sound = 0
    for _ in range(3000):
        corners = [(float(rng.randrange(6)), float(rng.randrange(6))) for _ in range(rng.randrange(3, 7))]
        valid = shapely.Polygon(corners).is_valid
        sound += valid
        assert valid == (not is_flat(corners) and not crosses_itself(corners)), corners
    assert 500 < sound < 2500
