"""What the documentation shows is run, and what its tables say is compared with the code."""

from __future__ import annotations

import importlib
import inspect
import re
import shutil
import sys
import tomllib
from dataclasses import replace
from pathlib import Path
from types import CodeType, FrameType
from typing import Any

import pytest
from typer.testing import CliRunner

from foresee_dsl.campaign.driving import DriverSetup, run_test_case
from foresee_dsl.campaign.steps.clip import measure_clip
from foresee_dsl.campaign.steps.forecast import clip_around
from foresee_dsl.cli import COMMANDS, app
from foresee_dsl.cli.added import ADDED
from foresee_dsl.compile import compile_test_case
from foresee_dsl.compile.nets.network_builder import build_network
from foresee_dsl.derive.mutate import mutate
from foresee_dsl.derive.operators import operators
from foresee_dsl.derive.presets import MutationPreset
from foresee_dsl.drivers.pdm import PdmDriver
from foresee_dsl.drivers.registry import load_driver
from foresee_dsl.errors import InputError
from foresee_dsl.files import data_folder
from foresee_dsl.forecast.registry import load_ranker
from foresee_dsl.language.document import TestCase
from foresee_dsl.language.keywords import KEYWORDS
from foresee_dsl.language.model import Campaign, Catalogue, Clip, Definition, Extension, Mutant, Network, Scenario
from foresee_dsl.language.model.campaign import Seeds
from foresee_dsl.language.parser import format_text, parse
from foresee_dsl.language.project.expand import expand_mutant
from foresee_dsl.language.project.loading import load_catalogue, load_test_case, load_test_cases
from foresee_dsl.language.units import UNITS
from foresee_dsl.simulate.results.verdict import RunResult, Verdict
from foresee_dsl.simulate.runner import run
from tests.support.code_frames import FRAMES

ROOT = Path(__file__).resolve().parent.parent
DOCS = ROOT / "docs"
PAGES = (ROOT / "README.md", *sorted(DOCS.rglob("*.md")))
LANGUAGE, NETWORKS, CLIPS, DRIVERS = (
    (DOCS / f"reference/{name}.md").read_text(encoding="utf-8") for name in ("language", "networks", "clips", "drivers")
)
LANGUAGE += NETWORKS + CLIPS


def blocks(text: str, kind: str) -> list[str]:
    return re.findall(rf"```{kind}\n(.*?)```", text, re.S)


FILES = [text for text in blocks(LANGUAGE, "foresee") if text.startswith("foresee 1\n")]
"""The snippets of the pages of the language that are whole files."""
SNIPPETS: dict[str, tuple[str, Definition]] = {}
for _text in FILES:
    _model = parse(_text, "docs/reference/language.md").model
    SNIPPETS[_model.name] = (_text, _model)


def named(kind: type) -> list[str]:
    return [name for name, (_, model) in SNIPPETS.items() if isinstance(model, kind)]


@pytest.fixture(scope="module")
def project(scenarios: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A copy of the scenarios with all snippets beside them, and the town as a foreign network."""
    folder = tmp_path_factory.mktemp("docs") / "scenarios"
    shutil.copytree(scenarios, folder)
    for name, (text, _) in SNIPPETS.items():
        assert not (folder / f"{name}.foresee").exists(), f"the snippet {name} is called like a bundled file"
        (folder / f"{name}.foresee").write_text(text, encoding="utf-8")
    for tracks in (ROOT / "tests/cases/docs").glob("*.tracks.csv"):
        shutil.copy(tracks, folder)
    town = compile_test_case(load_test_case(folder / "rude.foresee")).net_file
    shutil.copy(town, folder / "town.net.xml")
    return folder


FRAGMENTS = [
    (page.name, text) for page in PAGES for text in blocks(page.read_text(encoding="utf-8"), "foresee")
    if not text.startswith("foresee 1\n")
]  # fmt: skip
"""Statements that are shown alone."""
EXTENSION = 'foresee 1\n\nscenario longer extends "parent.foresee" {\n@\n}\n'


# ---- every page -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("page", "text"), FRAGMENTS, ids=[f"{page}-{k}" for k, (page, _) in enumerate(FRAGMENTS)])
def test_statements_that_are_shown_alone_are_parsed_and_in_the_one_layout(page: str, text: str) -> None:
    inside = "".join(f"  {line}\n" for line in text.splitlines()).rstrip("\n")
    for frame in (*(text for name, text in FRAMES.items() if name != "file"), EXTENSION):
        try:
            formatted = format_text(frame.replace("PIN", "sha256:5ef2c6120a41").replace("@", inside), page)
        except InputError:
            continue
        assert all(line.strip() in formatted for line in text.splitlines())
        return
    pytest.fail(f"no kind of file takes these statements of {page}:\n{text}")


def test_every_command_is_in_the_readme() -> None:
    table = PAGES[0].read_text(encoding="utf-8").partition("## The commands")[2].partition("\n## ")[0]
    assert {*(name for _, name, _ in COMMANDS), *ADDED.names()} == set(
        re.findall(r"`([a-z-]+)`", table.partition("\n\nEvery")[0])
    )


# ---- the language --------------------------------------------------------------------------------------------------


def drive(case: TestCase) -> RunResult:
    return run(compile_test_case(case), PdmDriver())


def test_every_kind_of_file_is_shown() -> None:
    assert len(SNIPPETS) == len(FILES)
    assert all(named(kind) for kind in (Scenario, Extension, Network, Catalogue, Clip, Mutant, Campaign))


@pytest.mark.parametrize("name", SNIPPETS)
def test_snippets_are_in_the_one_layout(name: str) -> None:
    text = SNIPPETS[name][0]
    assert format_text(text, name) == text


@pytest.mark.parametrize("name", named(Scenario) + named(Extension))
def test_scenarios_compile_and_run(project: Path, name: str) -> None:
    for case in load_test_cases([project / f"{name}.foresee"]):
        result = drive(case)
        assert result.verdict not in (Verdict.CRASH, Verdict.INVALID), f"{case.id}: {result.reason}"
        assert 0 < result.duration_s <= 8.0, "documentation is read, and tested: keep it short"


@pytest.mark.parametrize("name", named(Clip) + named(Mutant))
def test_clips_and_mutants_have_the_pins_of_their_parents_and_run(project: Path, name: str) -> None:
    result = drive(load_test_case(project / f"{name}.foresee"))
    assert result.verdict not in (Verdict.CRASH, Verdict.INVALID), result.reason


@pytest.mark.parametrize("name", named(Network))
def test_networks_can_be_built(project: Path, tmp_path: Path, name: str) -> None:
    model = SNIPPETS[name][1]
    assert isinstance(model, Network)
    build_network(model, tmp_path / "net.xml")
    assert b"<tlLogic" in (tmp_path / "net.xml").read_bytes()


@pytest.mark.parametrize("name", named(Catalogue))
def test_catalogues_can_be_loaded(project: Path, name: str) -> None:
    assert load_catalogue(project / f"{name}.foresee")


@pytest.mark.parametrize("name", named(Campaign))
def test_campaigns_have_no_mistakes_and_their_seeds_exist(project: Path, name: str) -> None:
    done = CliRunner().invoke(app, ["check", str(project / f"{name}.foresee")])
    assert done.exit_code == 0, done.output
    model = SNIPPETS[name][1]
    assert isinstance(model, Campaign)
    for item in model.body:
        assert not isinstance(item, Seeds) or any(project.glob(item.path)), item.path


def test_the_mutant_that_is_shown_fails_as_its_origin_says(project: Path) -> None:
    (name,) = named(Mutant)
    found = re.search(r'found "(.*)"', SNIPPETS[name][0])
    happens = drive(load_test_case(project / f"{name}.foresee")).reason
    assert found and happens.partition(" at ")[0] == found[1].partition(" at ")[0]  # as `foresee verify` compares
    assert SNIPPETS[name][0] in PAGES[0].read_text(encoding="utf-8"), "the README shows the same one"


def test_the_steps_that_are_shown_come_to_their_end(project: Path) -> None:
    """The example of sequences is one: every trigger fires, and every step of the first begins and ends."""
    result = drive(load_test_case(project / "stop_and_go.foresee"))
    events = result.trace.events
    assert {e.detail["index"] for e in events if e.what == "trigger"} == {0, 1, 2}
    assert [e.detail["where"] for e in events if e.what == "then"] == [[1], [1, 2]]
    assert [1] in [e.detail["where"] for e in events if e.what == "complete"]
    shown = result.expectations[1]
    assert f"{shown.text}  (by {shown.margin:.2f} {shown.unit})" in LANGUAGE


def test_the_review_of_the_mutant_that_is_shown(project: Path) -> None:
    page = (DOCS / "guide" / "review.md").read_text(encoding="utf-8")
    done = CliRunner().invoke(app, ["diff", str(project / "rude_p1_m1.foresee")])
    shown = page.partition("$ foresee diff rude_p1_m1.foresee\n")[2].partition("```")[0]
    assert done.output.strip() == shown.strip()
    pins = [re.findall(r"sha256:\w+", SNIPPETS[name][0])[0] for name in ("rude_p1", "rude_p1_m1")]
    assert re.findall(r"pin (sha256:\w+) =>", page) == pins


def test_cases_are_drawn_as_the_page_shows(project: Path) -> None:
    shown = LANGUAGE.partition("### What cases reach")[2]
    done = CliRunner().invoke(app, ["sample", str(project / "drawn.foresee")])
    assert done.exit_code == 0, done.output
    assert blocks(shown, "")[0].strip() == done.output.strip()


def test_every_word_of_the_language_is_in_the_reference() -> None:
    text = re.sub(r"```.*?```", "", LANGUAGE, flags=re.S)
    said = " ".join([*blocks(LANGUAGE, "foresee"), *re.findall(r"`[^`]+`", text)])
    missing = KEYWORDS.keys() - set(re.findall(r"\w+", said))
    assert not missing, f"docs/reference/ says nothing of {missing}"


def test_every_unit_is_listed() -> None:
    table = LANGUAGE.partition("| dimension | units |")[2].partition("\n\n")[0]
    assert set(re.findall(r"`([^`]+)`", table)) == set(UNITS)


@pytest.mark.parametrize(
    ("said", "name"),
    [
        ("followed by {:g} s of amber", "foresee_dsl.compile.nets.signals.AMBER_S"),
        ("{:g} s of all red", "foresee_dsl.compile.nets.signals.ALL_RED_S"),
        ("green ends {:g} s before", "foresee_dsl.compile.nets.signals.PEDESTRIAN_CLEARANCE_S"),
        ("A crossing is {:g} m wide", "foresee_dsl.compile.nets.network_builder.CROSSING_WIDTH_M"),
        ("of each lane | {:g} m |", "foresee_dsl.compile.nets.plain_edges.LANE_WIDTH_M"),
        ("the run's limit; {:g} s when absent", "foresee_dsl.language.model.scenario.DEFAULT_END_S"),
        ("{:g} m before the end of its route", "foresee_dsl.compile.placement.scene.GOAL_BEFORE_END_M"),
        ("friction from {:g} (0)", "foresee_dsl.compile.placement.scene.DRY_FRICTION"),
        ("to {:g} (1)", "foresee_dsl.compile.placement.scene.WET_FRICTION"),
        ("brakes with {:g} m/s^2", "foresee_dsl.simulate.orders.speed.STOPS_WITH_MPS2"),
        ("never over {:g} times its cruise speed", "foresee_dsl.simulate.orders.speed.HASTE"),
        ("counts as driving {:g} m/s at least", "foresee_dsl.simulate.orders.speed.WAITS_MPS"),
        ("From {:g} m before the junction on", "foresee_dsl.simulate.orders.speed.COMMITS_M"),
        ("({:g} m on a path)", "foresee_dsl.simulate.orders.speed.COMMITS_WALKING_M"),
        ("its front is within {:g} m of the lane's middle", "foresee_dsl.simulate.triggers.director.IN_LANE_M"),
        ("its speed is within {:g} m/s", "foresee_dsl.kernels.constants.STANDS_MPS"),
        ("draws {:,} cases at most", "foresee_dsl.language.sampling.MAX_CASES"),
        ("up to {:,} times for one case", "foresee_dsl.language.sampling.MAX_TRIES"),
        ("a range is {} parts at most", "foresee_dsl.language.sampling.BINS"),
        ("from {:g} m before it until its rear is out", "foresee_dsl.simulate.orders.speed.BOUND_FROM_M"),
        ("not under {:g} m/s, enters", "foresee_dsl.simulate.results.metrics.ETA_SLOWEST_MPS"),
        ("no nearer than {:g} m to a junction", "foresee_dsl.compile.placement.background_traffic.CORNER_M"),
        ("straight, over {:g} m of the path", "foresee_dsl.compile.placement.paths.LINE_OVER_M"),
        ("right; {:g} m at most", "foresee_dsl.language.model.actions.WIDEST_LINE_M"),
    ],
)
def test_figures_of_the_text_are_those_of_the_code(said: str, name: str) -> None:
    module, _, constant = name.rpartition(".")
    sentence = said.format(getattr(importlib.import_module(module), constant))
    assert sentence in " ".join(LANGUAGE.split())


# ---- drivers.md -----------------------------------------------------------------------------------------------------


@pytest.fixture
def plugins(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Install the page's examples as a package: the modules, and their entry points as pip would write them."""
    modules = re.findall(r"`(\w+\.py)`(?:,[^`\n]*)?:\n\n```python\n(.*?)```", DRIVERS, re.S)
    assert [name for name, _ in modules] == ["lane_keeper.py", "hardest_braking.py", "start_speed.py"]
    for name, text in modules:
        (tmp_path / name).write_text(text, encoding="utf-8")
    info = tmp_path / "docs_example-1.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: docs-example\nVersion: 1\n", encoding="utf-8")
    lines = []
    for block in blocks(DRIVERS, "toml"):
        for group, entries in tomllib.loads(block)["project"]["entry-points"].items():
            lines += [f"[{group}]", *(f"{name} = {value}" for name, value in entries.items())]
    (info / "entry_points.txt").write_text("\n".join(lines), encoding="utf-8")
    monkeypatch.syspath_prepend(str(tmp_path))
    return tmp_path


def example_preset() -> MutationPreset:
    """Execute the page's last block."""
    scope: dict[str, Any] = {}
    exec(blocks(DRIVERS, "python")[-1], scope)
    return scope["SLOWED"]


def test_the_examples_of_driver_ranker_and_operator_work(plugins: Path, scenarios: Path) -> None:
    case = load_test_case(scenarios / "scenario9.foresee::r01")
    driver = load_driver("lane_keeper")
    result = run(compile_test_case(case), driver)
    assert result.verdict is not Verdict.CRASH, result.reason
    ego = result.trace.states[:, 0]
    assert result.trace.meta["driver"] == "lane_keeper"
    assert result.duration_s > 4
    assert abs(ego[60:, 3] - 30 / 3.6).max() < 1.0, "it keeps its speed"

    points = load_ranker("hardest_braking").rank(result.trace, before_s=1.0)
    assert [p.rank for p in points] == list(range(1, len(points) + 1))
    assert [p.score for p in points] == sorted((p.score for p in points), reverse=True)

    assert "start_speed" in operators()
    file = plugins / "p1.foresee"
    draft = clip_around(case, result.trace, replace(points[0], frame=60), file, before_s=1.0, after_s=1.0)
    model, clip_case, clip_run, found = measure_clip(draft, case, result.trace, file, DriverSetup("lane_keeper"))
    assert found.largest_m < 0.1
    children = mutate(clip_case, model, clip_run.trace, preset=example_preset(), count=2, seed=0)
    assert children and all(change.property in ("speed", "delay") for m in children for change in m.changes)
    mutant = expand_mutant(children[0], clip_case, source=plugins / "p1_m1.foresee")
    assert run(compile_test_case(mutant), driver).verdict is not Verdict.CRASH


# ---- architecture.md ------------------------------------------------------------------------------------------------


def test_a_run_passes_the_functions_of_the_walk_in_their_order(tmp_path: Path) -> None:
    text = (DOCS / "background" / "architecture.md").read_text(encoding="utf-8")
    walk = text.partition("## A walk from text to verdict")[2].partition("\n## ")[0]
    named = re.findall(r"^\| \d+ \| `([\w.]+)`", walk, re.MULTILINE)
    codes = {_code_named(name): name for name in named}
    shutil.copytree(data_folder("scenarios") / "networks", tmp_path / "networks")
    scenario = (data_folder("scenarios") / "scenario7.foresee").read_text(encoding="utf-8")
    (tmp_path / "new.foresee").write_text(f"{scenario}# {tmp_path}\n", encoding="utf-8")  # a text never read before
    passed: dict[str, None] = {}

    def note(frame: FrameType, event: str, _: object) -> None:
        if event == "call" and frame.f_code in codes:
            passed[codes[frame.f_code]] = None

    sys.setprofile(note)
    try:
        (case,) = load_test_cases([f"{tmp_path / 'new.foresee'}::r01"])
        run_test_case(case, "idm", 0)
    finally:
        sys.setprofile(None)
    assert list(passed) == named
    assert len(named) == 10


def _code_named(name: str) -> CodeType:
    """Return the code of a function that a page names without the package."""
    owner, _, function = f"foresee_dsl.{name}".rpartition(".")
    try:
        holder: Any = importlib.import_module(owner)
    except ModuleNotFoundError:
        module, _, kind = owner.rpartition(".")
        holder = getattr(importlib.import_module(module), kind)
    code = inspect.unwrap(getattr(holder, function)).__code__
    assert isinstance(code, CodeType)
    return code


# ---- links ----------------------------------------------------------------------------------------------------------


def test_links_between_pages_lead_somewhere() -> None:
    for page in DOCS.rglob("*.md"):
        for target in re.findall(r"\]\(([^)#:]+)(?:#[^)]*)?\)", page.read_text(encoding="utf-8")):
            assert (page.parent / target).exists(), f"{page.name} links to {target}"


def test_files_that_are_named_exist(root: Path) -> None:
    for page in DOCS.rglob("*.md"):
        text = page.read_text()
        for name in re.findall(r"`((?:foresee_dsl|grammars|scenarios|templates|tests)/[\w./-]+)`", text):
            of_the_reader = f"Save this as `{name}`" in text
            assert of_the_reader or (root / name).exists(), f"{page.name} names {name}"
