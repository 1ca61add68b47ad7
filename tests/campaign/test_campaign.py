"""The whole line on real SUMO: same inputs, same bytes, whatever the number of workers; and the day after."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

from tests.support.command import foresee

CASES = ("scenario7.foresee::r01", "scenario8.foresee::r01")


def campaign(scenarios: Path, out: Path, *more: str, cases: tuple[str, ...] = CASES) -> dict[str, object]:
    arguments = [
        "campaign",
        *(str(scenarios / c) for c in cases),
        "--out",
        str(out),
        "--json",
        "--exit-zero",
        *more,
    ]
    done = foresee(*arguments)
    data = json.loads(done.stdout)
    standing = data.pop("standing")  # compared with the campaign before: not in the folder's own file
    assert not standing["gone"] and data == json.loads((out / "campaign.json").read_text())
    return data


def files(out: Path) -> dict[str, bytes]:
    return {str(f.relative_to(out)): f.read_bytes() for f in sorted((out / "children").rglob("*.foresee"))}


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, object]]:
    scenarios = Path(__file__).resolve().parents[2] / "scenarios"
    out = tmp_path_factory.mktemp("campaign") / "out"
    return out, campaign(scenarios, out, "--jobs", "2")


def test_the_contract_of_campaign_json(finished: tuple[Path, dict[str, object]]) -> None:
    _, data = finished
    assert next(iter(data)) == "schema"
    assert data["schema"] == 1
    keys = {
        "driver",
        "ranker",
        "seeds",
        "risky_points",
        "clips",
        "children",
        "failures",
        "fidelity_m",
        "simulated_s",
        "wall_s",
    }
    assert keys <= set(data)
    assert set(data["seeds"]) == {"total", "passed", "failed"}
    assert set(data["failures"]) == {"F1", "F2", "F3", "F4", "F5", "stuck", "rule"}
    assert set(data["fidelity_m"]) == {"median", "max"}


def test_clips_keep_to_their_parent(finished: tuple[Path, dict[str, object]]) -> None:
    _, data = finished
    assert data["clips"] >= 3
    assert all(c["deviation_m"]["median_others"] <= 0.005 for c in data["clip_runs"] if not c.get("not_run"))


def test_same_bytes_with_one_worker_and_into_the_same_folder(
    finished: tuple[Path, dict[str, object]], scenarios: Path
) -> None:
    out, first = finished
    before = files(out)
    second = campaign(scenarios, out, "--jobs", "1")
    assert files(out) == before
    assert {**second, "wall_s": 0} == {**first, "wall_s": 0}


def test_every_failure_is_reproduced_in_a_new_process(finished: tuple[Path, dict[str, object]]) -> None:
    out, data = finished
    found = sum(data["failures"].values())
    assert found > 0
    done = foresee("verify", out / "children", "--json", expect=None)
    report = json.loads(done.stdout)
    assert report["ok"] and report["counts"]["as_expected"] == len(report["tests"]) == found
    assert done.returncode == 0


def test_an_edited_parent_makes_its_children_stale(
    finished: tuple[Path, dict[str, object]], scenarios: Path, tmp_path: Path
) -> None:
    import shutil

    shutil.copytree(scenarios, tmp_path / "scenarios")
    cases = (CASES[0],)
    out = tmp_path / "out"
    data = campaign(tmp_path / "scenarios", out, cases=cases)
    file = tmp_path / "scenarios" / "scenario7.foresee"
    text = file.read_text()
    file.write_text(text.replace("# The ego crosses", "# A comment, changed: the ego crosses"))
    found = sum(data["failures"].values())
    assert verify(out)["as_expected"] == found
    file.write_text(re.sub(r"(case r01 .*gap = )[\d.]+", r"\g<1>1.7", text))
    assert file.read_text() != text
    assert verify(out)["stale"] == found


def verify(out: Path) -> dict[str, int]:
    done = foresee("verify", out / "children", "--json", expect=None)
    counts: dict[str, int] = json.loads(done.stdout)["counts"]
    return counts


def test_a_real_map_runs_through_the_whole_line(carla: Path, tmp_path: Path) -> None:
    """With the default preset the same test case has no clip, and the summary says why."""
    network = carla / "maps" / "xodr" / "Town10HD.xodr"
    out = tmp_path / "out"
    file = Path(__file__).parent / "town10hd.foresee"
    scenario = tmp_path / file.name
    scenario.write_text(file.read_text().replace("Town10HD.xodr", str(network)))
    options = ("campaign", scenario, "--out", out, "--allow-outside", "--exit-zero")
    data = json.loads(foresee(*options, "--json", "--preset", "focused").stdout)
    assert data["seeds"] == {"total": 1, "passed": 1, "failed": 0}
    assert data["clips"] > 0
    assert data["children"] > 0
    unpromising = foresee(*options).stdout
    assert "1 of 1 test case without clips: no change there promises a failure" in unpromising
    assert "--preset focused" in unpromising and "--risky-points" not in unpromising
