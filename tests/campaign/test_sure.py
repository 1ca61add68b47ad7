"""`foresee sure`: seeds, boundary, map and region of a finding, with real runs; the region is one of the language."""

from __future__ import annotations

from pathlib import Path

import pytest

from foresee_dsl.campaign.findings.diagnosing import failing_named
from foresee_dsl.campaign.findings.sure import SEEDS, SIDE, _largest_box, how_sure
from foresee_dsl.errors import ForeseeError
from foresee_dsl.language.project.loading import load_test_cases
from foresee_dsl.report.terminal.sureness import sureness_text
from tests.support.small_campaign import campaign, write_project


def test_the_box_is_the_largest_rectangle_of_failures_around_a_run() -> None:
    rows = [[bool(int(mark)) for mark in row] for row in ("00000", "01110", "01110", "00010", "00010")]
    assert _largest_box(rows, 2, 2) == (1, 2, 1, 3)
    assert _largest_box(rows, 4, 3) == (1, 4, 3, 3)
    assert _largest_box([[False, True, False]], 0, 1) == (0, 0, 1, 1)


def test_a_finding_with_all_its_figures(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write_project(tmp_path)
    monkeypatch.chdir(tmp_path)
    result, _ = campaign([tmp_path / "crosser.foresee"], tmp_path / "out")
    failing = failing_named(result.findings[0].name, tmp_path / "out")
    counts: list[tuple[int, int]] = []
    sure = how_sure(failing, 1, lambda done, of: counts.append((done, of)), tmp_path / "region")
    assert sure.seeds == SEEDS and 1 <= sure.failed <= SEEDS and counts[-1][0] == counts[-1][1]
    assert failing.case.mutant is not None and sure.edges and sure.map is not None and sure.region is not None
    for edge in sure.edges:
        assert edge.distance is None or edge.distance > 0
    assert len(sure.map.fails) == SIDE and all(len(row) == SIDE for row in sure.map.fails)
    own = SIDE // 2 if sure.map.down != "seed" else 0
    assert sure.map.fails[own][SIDE // 2] is True
    assert sure.region.failed == sure.region.drawn == 5
    cases = load_test_cases([sure.region.files[-1]], allow_outside=True)
    assert len(cases) == 5 and sure.region.require in sure.region.files[-1].read_text()
    text = sureness_text(sure)
    assert f"{sure.failed} of {SEEDS} sensor seeds fail" in text and max(map(len, text.splitlines())) <= 120
    again = how_sure(failing, 2)
    assert (again.failed, again.edges, again.map) == (sure.failed, sure.edges, sure.map)


def test_what_does_not_fail_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write_project(tmp_path)
    monkeypatch.chdir(tmp_path)
    failing = failing_named("crosser.foresee::after", tmp_path / "out", driver="idm")
    with pytest.raises(ForeseeError, match="does not fail with idm and seed 0 any more"):
        how_sure(failing)
