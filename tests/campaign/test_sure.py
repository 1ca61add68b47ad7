"""`foresee sure`: seeds, boundary, map and region of a finding, with real runs; the region is one of the language."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from lxml import html

from foresee_dsl.campaign.findings.diagnosing import failing_named
from foresee_dsl.campaign.findings.sure import _largest_box, how_sure
from foresee_dsl.campaign.findings.sureness import (
    FILE,
    SEEDS,
    SIDE,
    Edge,
    HeatMap,
    Region,
    Sureness,
    keep_sureness,
    kept_sureness,
    sureness_of,
)
from foresee_dsl.errors import ForeseeError
from foresee_dsl.language.project.loading import load_test_cases
from foresee_dsl.report.page.html import write_report
from foresee_dsl.report.page.markdown import write_markdown
from foresee_dsl.report.terminal.review import sureness_text
from tests.support import command
from tests.support.first_project import checked
from tests.support.small_campaign import finished, write_project


def test_the_box_is_the_largest_rectangle_of_failures_around_a_run() -> None:
    rows = [[bool(int(mark)) for mark in row] for row in ("00000", "01110", "01110", "00010", "00010")]
    assert _largest_box(rows, 2, 2) == (1, 2, 1, 3)
    assert _largest_box(rows, 4, 3) == (1, 4, 3, 3)
    assert _largest_box([[False, True, False]], 0, 1) == (0, 0, 1, 1)


def test_a_finding_with_all_its_figures(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write_project(tmp_path)
    monkeypatch.chdir(tmp_path)
    result = finished(tmp_path / "crosser.foresee", tmp_path / "out")
    failing = failing_named(result.findings[0].name, tmp_path / "out")
    counts: list[tuple[int, int]] = []
    sure = how_sure(failing, 1, lambda done, of: counts.append((done, of)), tmp_path / "region")
    assert sure.seeds == SEEDS and 1 <= sure.failed <= SEEDS and counts[-1][0] == counts[-1][1]
    assert failing.case.mutant is not None and sure.edges and sure.map is not None and sure.region is not None
    for edge in sure.edges:
        assert edge.distance is None or edge.distance > 0
    assert len(sure.map.fails) == SIDE and all(len(row) == SIDE for row in sure.map.fails)
    assert sure.map.unmutated[0] == sure.map.columns[0], "the map begins at the unmutated value"
    own = SIDE // 2 if sure.map.down != "seed" else 0
    assert sure.map.fails[own][SIDE // 2] is True
    assert sure.region.failed == sure.region.drawn == 5
    cases = load_test_cases([sure.region.files[-1]], allow_outside=True)
    assert len(cases) == 5 and sure.region.require in sure.region.files[-1].read_text()
    assert sure.reason.startswith("F") and sure.map.own == (own, SIDE // 2)
    text = sureness_text(sure)
    assert f"{sure.failed} of {SEEDS} sensor seeds fail" in text and max(map(len, text.splitlines())) <= 120
    checked(command.foresee("sure", sure.name, "--jobs", 2, "--json").stdout)
    again = kept_sureness(tmp_path / "out")[sure.name]
    assert again == replace(sure, region=replace(sure.region, files=()))


def test_what_is_kept_is_shown_with_the_run_that_it_is_about(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write_project(tmp_path)
    monkeypatch.chdir(tmp_path)
    result = finished(tmp_path / "crosser.foresee", tmp_path / "out")
    finding = result.findings[0]
    edge = Edge("other.timing", "", 1.0, 1.2, 1.1, None, 9)
    fails = ((False, False, True), (False, True, True), (None, True, False))
    heat_map = HeatMap("other.timing", "other.delay", ("1.00", "1.20", "1.40"), ("0.00 s", "0.10 s", "0.20 s"), fails,
                       ("1.00", "0.00 s"))  # fmt: skip
    region = Region(("param other_timing: ratio",), "require other_timing >= 1.2", 5, 5)
    name, reason = finding.name, finding.run.reason
    sure = Sureness(name, finding.number, "idm", reason, SEEDS, 17, (edge,), heat_map, region)
    keep_sureness(tmp_path / "out", sure)
    assert kept_sureness(tmp_path / "out") == {name: sure}
    assert sureness_of(tmp_path / "out", name, "F9 something else") is None

    write_report([tmp_path / "out"], tmp_path / "report.html")
    page = html.document_fromstring((tmp_path / "report.html").read_text())
    (figure,) = page.get_element_by_id(f"finding-{name}").iter("figure")
    cells = [group for group in figure.iter("g") if group.get("class") == "cell"]
    paints = {True: "p-fails", False: "p-passes", None: "p-quiet"}
    assert [next(cell.iter("path")).get("class") for cell in cells] == [paints[run] for row in fails for run in row]
    assert [len(list(cell.iter("path"))) for cell in cells] == [1, 1, 1, 1, 2, 1, 1, 1, 1], "the finding has a frame"
    assert next(cells[4].iter("title")).text == "other.timing 1.20, other.delay 0.10 s: fails, the finding"
    assert "9 runs, of which 4 fail" in next(figure.iter("svg")).get("aria-label", "")
    texts = {text.text: text.get("class") for text in figure.iter("text")}
    assert {"1.40", "0.20", "other.timing", "other.delay, s"} <= texts.keys()
    assert {text for text, style in texts.items() if style.endswith(" b")} == {"1.00", "0.00"}, "the unmutated ones"
    write_markdown([tmp_path / "out"], tmp_path / "report.md")
    review = command.foresee("review", name).stdout
    for shown in (page.text_content(), " ".join(review.split()), (tmp_path / "report.md").read_text()):
        assert "17 of 20" in shown and "fails at 1.20; passes at 1.10" in shown
    assert checked(command.foresee("report", "out", "--format", "json").stdout)["findings"][0]["sure"]["failed"] == 17

    keep_sureness(tmp_path / "out", replace(sure, reason="F9 something else"))
    write_report([tmp_path / "out"], tmp_path / "report.html")
    assert "sensor seeds fail" not in (tmp_path / "report.html").read_text(), "it is about another run"
    (tmp_path / "out" / FILE).write_text("[1]")
    with pytest.raises(ForeseeError, match=r"sure\.json was not written by `foresee sure`"):
        write_report([tmp_path / "out"], tmp_path / "report.html")


def test_what_does_not_fail_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write_project(tmp_path)
    monkeypatch.chdir(tmp_path)
    failing = failing_named("crosser.foresee::after", tmp_path / "out", driver="idm")
    with pytest.raises(ForeseeError, match="does not fail with idm and seed 0 any more"):
        how_sure(failing)
