"""What keeps the command line quick: what it imports, and how costs grow. No test asserts seconds."""

import gc
import itertools
import os
import subprocess
import sys
import time
from importlib.util import find_spec
from pathlib import Path

import pytest

from benchmarks.texts import anew, scenario
from foresee_dsl import disk_cache
from foresee_dsl.compile import compile_test_case, placement_mistakes
from foresee_dsl.errors import InputError
from foresee_dsl.files import data_folder
from foresee_dsl.language.parser import format_text, load, parse
from foresee_dsl.language.project.loading import Project

SCENARIO = data_folder("scenarios") / "scenario3.foresee"
HEAVY = {"numpy", "scipy", "shapely", "networkx", "numba", "jinja2", "libsumo", "defusedxml"}
ONLY_FOR_MISTAKES = {"rich", "foresee_dsl.language.checks.broken_files"}
ONLY_FOR_NEW_NETWORKS = {
    f"foresee_dsl.compile.{name}"
    for name in (
        "nets.network_builder",
        "nets.net_reader",
        "nets.signals",
        "foreign.networks",
        "placement.background_traffic",
        "sumo_files",
    )
} | {"gzip", "xml.etree.ElementTree"}
ONLY_FOR_RUNS = {f"foresee_dsl.{name}" for name in ("campaign", "derive", "editor", "exchange", "forecast", "kernels",
                                                    "report.page", "report.picture", "report.terminal", "report.show",
                                                    "simulate", "story")}  # fmt: skip
# The package `report` itself is loaded for its module `formats`: packages may add formats to what a check reports.
NO_CHECK = {"foresee_exchange"} | HEAVY | ONLY_FOR_MISTAKES | ONLY_FOR_NEW_NETWORKS | ONLY_FOR_RUNS
"""What a check of a file of a known network does not load."""


def imported(*arguments):
    """Run the command line in a new process and return the names of the modules that it imported."""
    code = (
        "import sys\nfrom foresee_dsl.cli import main\n"
        "try:\n    main()\nexcept SystemExit as end:\n    assert not end.code, end.code\n"
        "print('\\n'.join(sorted(sys.modules)), file=sys.stderr)"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, *map(str, arguments)], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    return set(done.stderr.split())


@pytest.fixture
def edited(tmp_path):
    """A scenario that was never placed before, beside a network that was built."""
    (tmp_path / "networks").mkdir()
    town = data_folder("scenarios") / "networks" / "town.foresee"
    (tmp_path / "networks" / "town.foresee").write_text(town.read_text())
    file = tmp_path / "edited.foresee"
    file.write_text(SCENARIO.read_text().replace("start at 12 m along", f"start at {12 + hash_of(tmp_path)} m along"))
    return file


def hash_of(path: Path) -> float:
    """A number under 1 that differs from path to path."""
    return round(sum(k * ord(c) for k, c in enumerate(str(path), 1)) % 997 / 1000, 3)


def test_a_check_imports_no_heavy_library(edited):
    imported("check", SCENARIO)  # the network goes into the cache
    assert imported("check", edited) & NO_CHECK == set()
    again = imported("check", edited)
    assert "foresee_dsl.compile.compiler" not in again, "an unchanged case is not placed again"


def test_what_a_check_must_not_import_exists():
    """A name of a module that was moved would never be found among the imported ones."""
    missing = {name for name in NO_CHECK if find_spec(name) is None}
    assert missing == set()


def test_only_the_validators_that_a_file_needs_are_built():
    code = (
        "from foresee_dsl.language import model as m\nfrom foresee_dsl.language.parser import parse\n"
        "parse('foresee 1\\nnetwork n { junction a at (0 m, 0 m) }\\n', 'x')\n"
        "items = [kind for kind in vars(m).values() if isinstance(kind, type) and issubclass(kind, m.Item)]\n"
        "print(*(kind.__name__ for kind in items if kind.__pydantic_complete__))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    built = set(done.stdout.split())
    assert {"Network", "Junction", "Point", "Quantity"} <= built
    assert not built & {"Scenario", "Actor", "Clip", "Mutant", "Extension", "When", "Road"}


def test_items_are_read_back_from_what_they_are_dumped_as():
    scenario = load(SCENARIO).model
    assert type(scenario).model_validate_json(scenario.model_dump_json()) == scenario
    assert type(scenario).model_validate(scenario.model_dump()) == scenario


def test_help_imports_neither_the_language_nor_a_heavy_library():
    assert imported("--help") & (HEAVY | {"pydantic", "lark"}) == set()


def test_placing_for_a_check_finds_what_the_compiler_finds(tmp_path):
    text = SCENARIO.read_text().replace(
        "networks/town.foresee", str(data_folder("scenarios") / "networks/town.foresee")
    )
    for right, wrong in (
        ("start at 12 m along ego.route", "start at 12000 m along ego.route"),
        ("start at 12 m along ego.route", "start at (900 m, 900 m)"),
        ("goal 60 m past", "goal 6000 m past"),
        ("offset -3.6 m", "offset -300 m"),
        ("start speed 40 km/h", "start speed 400 km/h"),
    ):
        file = tmp_path / f"wrong{len(wrong)}.foresee"
        file.write_text(text.replace(right, wrong))
        for case in Project().test_cases([str(file)]):
            try:
                compile_test_case(case)
                compiled = ()
            except InputError as error:
                compiled = error.diagnostics
            assert compiled, wrong
            assert placement_mistakes([case]) == compiled
            assert placement_mistakes([case]) == compiled, "mistakes are found again"


def test_a_kept_document_is_the_one_that_was_parsed():
    file = data_folder("scenarios") / "networks" / "town.foresee"
    load(file)
    taken, parsed = load(file), parse(file.read_text(), str(file))
    assert (taken.model, taken.comments, taken.text) == (parsed.model, parsed.comments, parsed.text)
    for one, other in zip(taken.model.body, parsed.model.body, strict=True):
        assert taken.span(one) == parsed.span(other) is not None
    assert len(taken.spans) == len(parsed.spans)


def test_a_damaged_kept_value_is_made_again(tmp_path, monkeypatch):
    monkeypatch.setenv("FORESEE_CACHE", str(tmp_path))
    place = disk_cache.entry("things", ("a", b"b"))
    assert disk_cache.load(place) is None
    disk_cache.store(place, {"x": 1})
    assert disk_cache.load(place) == {"x": 1}
    assert disk_cache.entry("things", ("ab", b"")) != place
    place.write_bytes(place.read_bytes()[:-1])
    assert disk_cache.load(place) is None
    monkeypatch.setenv("FORESEE_CACHE", str(place))  # a file: no folder can be made there
    with pytest.warns(UserWarning, match="cannot be used"):
        elsewhere = disk_cache.entry("things", ("a",))
    assert elsewhere is not None and tmp_path not in elsewhere.parents
    disk_cache.store(None, 1)
    assert disk_cache.load(None) is None


def test_the_older_half_of_too_much_is_thrown_away(tmp_path, monkeypatch):
    monkeypatch.setenv("FORESEE_CACHE", str(tmp_path))
    monkeypatch.setattr(disk_cache, "MOST", 6)
    places = [disk_cache.entry("many", (str(k),)) for k in range(7)]
    for k, place in enumerate(places[:6]):
        disk_cache.store(place, k)
        os.utime(place, ns=(k, k))
    disk_cache.store(places[6], 6)
    assert [disk_cache.load(place) for place in places] == [None, None, None, 3, 4, 5, 6]


def test_a_check_is_linear_in_the_length_and_formatting_no_dearer_than_four_parses():
    number = itertools.count()

    def cost(work, text):
        spent = []
        gc.disable()  # as timeit does: a collection costs by what other tests have left behind
        for _ in range(5):
            new = anew(text, next(number))
            begin = time.process_time()
            work(new)
            spent.append(time.process_time() - begin)
        gc.enable()
        return min(spent)

    short, long = scenario(500), scenario(4000)
    parse(short, "x")  # the lexer's tables are made at the first use
    assert cost(lambda text: parse(text, "x"), long) / cost(lambda text: parse(text, "x"), short) < 8 * 1.8
    assert cost(lambda text: format_text(text, "x"), short) / cost(lambda text: parse(text, "x"), short) < 5
