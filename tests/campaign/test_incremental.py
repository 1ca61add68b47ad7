"""What is run again, and what is not: a result depends on what its key contains, and on nothing else."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path

import pytest

from foresee_dsl.campaign.keys import driver_identity, key
from foresee_dsl.campaign.plan import plan_campaign
from foresee_dsl.campaign.settings import CampaignLimits, Shard
from foresee_dsl.campaign.stages import Stages
from foresee_dsl.campaign.steps.case_run import CaseStep
from foresee_dsl.campaign.steps.clip import ClipStep
from foresee_dsl.campaign.storage.maintenance import merge
from foresee_dsl.campaign.storage.store import Store
from foresee_dsl.campaign.workers.pool import RunOptions
from foresee_dsl.documents import plain
from foresee_dsl.drivers.consent import allow
from foresee_dsl.language.project.loading import load_test_cases
from tests.support.small_campaign import SETTINGS, Heard, campaign, published, write_project


@pytest.fixture(scope="module")
def done(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path, Heard]:
    """A project, and its finished campaign's folder."""
    root = tmp_path_factory.mktemp("incremental")
    file = write_project(root / "project")
    _, heard = campaign(file, root / "out", options=RunOptions(jobs=2))
    return file, root / "out", heard


@pytest.fixture
def again(done: tuple[Path, Path, Heard], tmp_path: Path) -> tuple[Path, Path]:
    """A copy of both, beside each other as they were, to be edited."""
    file, out, _ = done
    shutil.copytree(file.parent, tmp_path / "project")
    shutil.copytree(out, tmp_path / "out")
    return tmp_path / "project" / file.name, tmp_path / "out"


def test_all_stages_ran_and_failures_were_found(done: tuple[Path, Path, Heard]) -> None:
    _, out, heard = done
    assert [heard.count(kind) for kind in ("seed", "forecast", "clip", "mutants", "child")] == [3, 3, 3, 3, 12]
    assert 0 < heard.count("minimise") == len(published(out)["json"]["findings"])
    assert sum(published(out)["json"]["failures"].values()) > 0
    assert not list(out.glob(".work-*"))


def test_a_second_campaign_runs_nothing_and_gives_the_same(done: tuple[Path, Path, Heard]) -> None:
    file, out, first = done
    before = published(out)
    _, heard = campaign(file, out)
    assert heard.kinds == []
    assert sorted(heard.old) == sorted(first.kinds)
    assert published(out) == before


def test_a_campaign_whose_results_are_all_stored_is_not_interrupted_by_a_stop(done: tuple[Path, Path, Heard]) -> None:
    file, out, _ = done
    before = published(out)
    result, heard = campaign(file, out, options=RunOptions(stop=lambda: True))
    assert not result.interrupted and heard.kinds == []
    assert published(out) == before


def test_another_folder_shares_the_store_under_its_own_names(done: tuple[Path, Path, Heard], tmp_path: Path) -> None:
    """Parents' paths and names in the texts are this campaign's; all else is as the first wrote it."""
    file, out, _ = done
    other = tmp_path / "deep" / "er"
    _, heard = campaign(file, other, store=out / "store")
    assert heard.kinds == []
    mine, theirs = published(other), published(out)
    assert mine["json"] == theirs["json"]
    assert mine["files"].keys() == theirs["files"].keys() and mine["traces"].keys() == theirs["traces"].keys()
    for name in mine["files"]:
        assert mine["files"][name].split(b"\n")[3:] == theirs["files"][name].split(b"\n")[3:]
    load_test_cases([other / name for name in mine["files"]])  # their parents are found, and their pins hold


def test_a_comment_changes_nothing(again: tuple[Path, Path]) -> None:
    file, out = again
    file.write_text(file.read_text().replace("# Somebody", "# Another comment. Somebody"))
    _, heard = campaign(file, out)
    assert heard.kinds == []


def test_one_edited_case_runs_what_depends_on_it_alone(again: tuple[Path, Path]) -> None:
    file, out = again
    text = file.read_text()
    file.write_text(text.replace("case last { gap = -0.9 s }", "case last { gap = -1.1 s }"))
    assert file.read_text() != text
    _, heard = campaign(file, out)
    assert heard.count("seed") == 1
    assert heard.names and all(name.startswith("crosser_last") for name in heard.names)


def test_more_children_run_no_seed_no_clip_and_no_known_child(again: tuple[Path, Path]) -> None:
    file, out = again
    before = published(out)["files"]
    _, heard = campaign(file, out, replace(SETTINGS, children=6))
    assert [heard.count(kind) for kind in ("seed", "forecast", "clip", "mutants")] == [0, 0, 0, 3]
    assert 0 < heard.count("child") <= 6
    assert all(name.endswith(("_m5", "_m6")) for name in heard.names if "_m" in name)
    assert before.items() <= published(out)["files"].items()


@pytest.mark.parametrize(
    ("change", "runs"),
    [
        ({"risky_points": 1}, {"forecast", "minimise"}),
        ({"ranker": "proximity"}, {"forecast", "clip", "mutants", "child", "minimise"}),
        ({"fidelity_limit_m": 0.5}, {"minimise"}),
    ],
)
def test_a_setting_runs_again_what_it_matters_to(
    again: tuple[Path, Path], change: dict[str, object], runs: set[str]
) -> None:
    file, out = again
    _, heard = campaign(file, out, replace(SETTINGS, **change))
    assert set(heard.kinds) <= runs
    assert ("forecast" in heard.kinds) == ("forecast" in runs)


def test_repeating_mutates_the_same_clips_with_the_next_seeds(again: tuple[Path, Path]) -> None:
    file, out = again
    _, heard = campaign(file, out, replace(SETTINGS, repeat=2))
    assert [heard.count(kind) for kind in ("seed", "forecast", "clip", "mutants")] == [0, 0, 0, 3]
    assert heard.count("child") > 0
    assert all("_s1_m" in name for name in heard.names if "_m" in name)
    data = published(out)["json"]
    assert data["children"] == 12 + heard.count("child")


def test_parts_of_a_campaign_merge_into_the_whole(done: tuple[Path, Path, Heard], tmp_path: Path) -> None:
    file, out, whole = done
    kinds: list[str] = []
    for k in (1, 2):
        _, heard = campaign(
            file, tmp_path / f"part{k}", store=tmp_path / f"s{k}", options=RunOptions(shard=Shard(k, 2), jobs=2)
        )
        kinds += heard.kinds
    # Nothing twice, nothing left out. What is one finding of the whole may be one of each part, and is minimised there.
    assert sorted(k for k in kinds if k != "minimise") == sorted(k for k in whole.kinds if k != "minimise")
    assert kinds.count("minimise") >= whole.count("minimise")
    merge([tmp_path / "s1", tmp_path / "s2"], tmp_path / "joined")
    _, heard = campaign(file, tmp_path / "out", store=tmp_path / "joined")
    assert heard.kinds == []
    mine, theirs = published(tmp_path / "out"), published(out)
    assert mine["json"] == theirs["json"]


@pytest.mark.parametrize("text", ["0/2", "3/2", "1", "a/b", "1/0", "-1/2", "1/2/3"])
def test_a_part_that_is_none_is_refused(text: str) -> None:
    with pytest.raises(ValueError, match="not a part of a campaign"):
        Shard.parse(text)
    assert Shard.parse("2/8") == Shard(2, 8)


def test_time_that_is_up_begins_nothing_more(done: tuple[Path, Path, Heard], tmp_path: Path) -> None:
    file, _, _ = done
    result, heard = campaign(file, tmp_path / "out", options=RunOptions(limits=CampaignLimits(budget_s=0.0)))
    assert result.interrupted and heard.kinds == []
    assert published(tmp_path / "out")["json"]["interrupted"] is True


def test_the_plan_knows_what_is_done_and_what_may_follow(again: tuple[Path, Path]) -> None:
    file, out = again
    file.write_text(file.read_text().replace("case last { gap = -0.9 s }", "case last { gap = -1.1 s }"))
    cases = load_test_cases([file])
    with Store(out / "store", write=False) as store:
        plan = plan_campaign(Stages(cases, SETTINGS, store, out), store, jobs=2)
        fresh = plan_campaign(Stages(cases, SETTINGS, None, out), None, jobs=1)
    assert [(s.done, s.to_run, s.at_most) for s in plan.stages] == [
        (2, 1, 0), (0, 0, 0), (2, 0, 1), (2, 0, 2), (2, 0, 2), (8, 0, 8), (0, 0, 0), (0, 0, 0), (0, 0, 9), (0, 0, 0)
    ]  # fmt: skip
    assert plan.measured and not fresh.measured
    assert [(s.done, s.to_run, s.at_most) for s in fresh.stages] == [
        (0, 3, 0), (0, 0, 0), (0, 0, 3), (0, 0, 6), (0, 0, 6), (0, 0, 24), (0, 0, 0), (0, 0, 0), (0, 0, 24), (0, 0, 0)
    ]  # fmt: skip
    assert plan.as_dot().count("->") == plan.graph.number_of_edges() == plan.graph.number_of_nodes() - 3
    assert plain(plan)["runs"] == {"to_run": 1, "at_most_more": 19}


def test_keys_contain_what_a_result_depends_on(tmp_path: Path) -> None:
    keys = {
        key(CaseStep, meaning="a", driver="d", seed=0),
        key(CaseStep, meaning="b", driver="d", seed=0),
        key(CaseStep, meaning="a", driver="e", seed=0),
        key(CaseStep, meaning="a", driver="d", seed=1),
        key(ClipStep, meaning="a", driver="d", seed=0),
    }
    assert len(keys) == 5
    assert key(CaseStep, meaning="a", driver="d", seed=0) in keys
    program = tmp_path / "mine.py"
    program.write_text("print(1)")
    address = f"external:python3 {program}"
    allow(address)
    one = driver_identity(address)
    assert driver_identity(address) == one
    program.write_text("print(2)")
    assert driver_identity(address) != one
    assert driver_identity("idm") != driver_identity("pdm")
