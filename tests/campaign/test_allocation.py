"""Children that are allocated in rounds: as many as with `even`, the same ones for any workers, and where they pay."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from foresee_dsl.campaign.allocation.adaptive import (
    AGAIN,
    NEW,
    NEW_UNAVOIDED,
    Adaptive,
    MutantDraws,
    ValuedChild,
    halved,
    ranked,
    worths,
)
from foresee_dsl.campaign.allocation.draws import ChildFacts, DrawMethod, PastChild
from foresee_dsl.campaign.allocation.rounds import Round, spread
from foresee_dsl.campaign.plan import plan_campaign
from foresee_dsl.campaign.settings import Shard
from foresee_dsl.campaign.stages import Stages
from foresee_dsl.campaign.storage.maintenance import merge
from foresee_dsl.campaign.storage.store import Store
from foresee_dsl.campaign.workers.pool import RunOptions
from foresee_dsl.documents import plain
from foresee_dsl.language.project.loading import load_test_cases
from tests.support.small_campaign import SETTINGS, Heard, campaign, published, write_project

ADAPTIVE = replace(SETTINGS, allocation="adaptive", against=("pdm",))


class HeardRounds(Heard):
    """Remembers the rounds as well, and asks to stop when the third begins, if it is told to."""

    def __init__(self, *, stops: bool = False) -> None:
        super().__init__()
        self.rounds: list[Round] = []
        self._stops = stops

    def round(self, begun: Round) -> None:
        self.rounds.append(begun)

    def stop(self) -> bool:
        return self._stops and len(self.rounds) >= 2


@pytest.fixture(scope="module")
def done(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path, HeardRounds]:
    """A project, the folder of its campaign, and what was heard."""
    root = tmp_path_factory.mktemp("allocation")
    file, heard = write_project(root / "project"), HeardRounds()
    campaign(file, root / "out", ADAPTIVE, options=RunOptions(jobs=2), heard=heard)
    return file, root / "out", heard


def test_there_are_as_many_children_as_with_even_and_the_rounds_say_who_gets_them(
    done: tuple[Path, Path, HeardRounds],
) -> None:
    _, out, heard = done
    data = published(out)["json"]
    clips = {clip["clip"]: clip["children"] for clip in data["clip_runs"]}
    children = [child for made in clips.values() for child in made]
    assert len(children) == heard.count("child") == ADAPTIVE.children * len(clips)
    assert len({child["mutant"] for child in children}) == len({child["meaning"] for child in children})
    assert [one.number for one in heard.rounds] == list(range(2, Adaptive.rounds + 1))
    for one in heard.rounds:
        asked = [child for child in children if child["round"] == one.number]
        assert len(asked) == one.children == sum(one.clips.values()) == sum(one.ways.values())
        assert one.total == len(children)
    near = [child for child in children if child["drawn_near"]]
    names = {child["mutant"]: child for child in children}
    assert near
    assert all(names[child["drawn_near"]]["round"] < child["round"] for child in near)
    assert all(names[child["drawn_near"]]["verdict"] == "pass" for child in near)


def test_one_worker_that_is_stopped_between_gives_the_same(
    done: tuple[Path, Path, HeardRounds],
) -> None:
    file, out, first = done
    mine = out.with_name("one_worker")
    stopped = HeardRounds(stops=True)
    result, _ = campaign(file, mine, ADAPTIVE, options=RunOptions(stop=stopped.stop), heard=stopped)
    assert result.interrupted and len(stopped.rounds) < Adaptive.rounds
    with Store(mine / "store", write=False) as store:
        stages = Stages(load_test_cases([file]), ADAPTIVE, store, mine)
        found = {stage.kind: stage for stage in plan_campaign(stages, store, jobs=1).stages}["child"]
    assert found.done + found.to_run + found.at_most == first.count("child")
    again = HeardRounds()
    campaign(file, mine, ADAPTIVE, heard=again)
    assert sorted(stopped.kinds + again.kinds) == sorted(first.kinds)
    assert again.rounds == first.rounds
    assert published(mine) == published(out)
    result, third = campaign(file, mine, ADAPTIVE, options=RunOptions(stop=lambda: True), heard=HeardRounds())
    assert not result.interrupted and third.kinds == []
    assert published(mine) == published(out)


def test_even_shares_what_both_have_drawn(done: tuple[Path, Path, HeardRounds], tmp_path: Path) -> None:
    file, out, first = done
    shutil.copytree(out, tmp_path / "out")
    even = replace(ADAPTIVE, allocation="even")
    _, heard = campaign(file, tmp_path / "out", even)
    assert heard.count("seed") == heard.count("clip") == 0
    assert heard.count("child") <= first.count("child") - len(published(out)["json"]["clip_runs"])
    assert published(tmp_path / "out")["json"]["clip_runs"][0]["children"][0]["round"] is None


def test_parts_have_rounds_of_their_own_which_all_parts_together_share(
    done: tuple[Path, Path, HeardRounds], tmp_path: Path
) -> None:
    file, out, whole = done
    for k in (1, 2):
        shutil.copytree(out / "store", tmp_path / f"s{k}")  # what the whole has run need not be run again
        options = RunOptions(shard=Shard(k, 2), jobs=2)
        campaign(file, tmp_path / f"part{k}", ADAPTIVE, store=tmp_path / f"s{k}", options=options)
    merge([tmp_path / "s1", tmp_path / "s2"], tmp_path / "joined")
    _, heard = campaign(
        file, tmp_path / "out", ADAPTIVE, store=tmp_path / "joined", options=RunOptions(shard=Shard.parse("all/2"))
    )
    assert not {"seed", "clip", "mutants", "child", "reference"} & set(heard.kinds)
    parts = [published(tmp_path / f"part{k}")["json"]["clip_runs"] for k in (1, 2)]
    together = published(tmp_path / "out")["json"]["clip_runs"]
    assert sorted((plain(clip) for part in parts for clip in part), key=lambda c: c["clip"]) == together
    assert sum(len(clip["children"]) for clip in together) == whole.count("child")


def test_the_plan_says_what_rounds_there_are(done: tuple[Path, Path, HeardRounds]) -> None:
    file, out, first = done
    cases = load_test_cases([file])
    before = plan_campaign(Stages(cases, ADAPTIVE, None, out), None, jobs=1)
    assert before.allocation is not None and before.allocation.sentence.startswith(
        f"children are allocated in {Adaptive.rounds}"
    )
    assert not before.allocation.later_rounds
    most = {stage.kind: stage.at_most for stage in before.stages}["child"]
    assert most == ADAPTIVE.children * ADAPTIVE.risky_points * len(cases)
    with Store(out / "store", write=False) as store:
        after = plan_campaign(Stages(cases, ADAPTIVE, store, out), store, jobs=1)
    assert after.allocation is not None and list(after.allocation.later_rounds) == first.rounds
    assert after.runs_to_do == (0, 0)


def test_a_failure_is_worth_most_when_it_is_new_and_could_have_been_avoided() -> None:
    failure, near = (
        ChildFacts(("3", "vehicle"), avoidable=False, nearness=0.0),
        ChildFacts((), avoidable=False, nearness=0.5),
    )
    other = ChildFacts(("3", "pedestrian"), avoidable=True, nearness=0.0)
    way = DrawMethod(("steer",))
    found = worths(
        PastChild("clip", "3", way, facts, avoided=avoided)
        for facts, avoided in ((failure, False), (failure, True), (near, False), (other, True))
    )
    assert found[0] == NEW_UNAVOIDED and found[1] == NEW * AGAIN and found[3] == NEW
    assert 0 < found[2] < found[1]


def test_children_go_where_those_before_failed() -> None:
    steer, line = DrawMethod(("steer",)), DrawMethod(("line",))
    clips = [f"clip{k}" for k in range(8)]
    tried = [
        ValuedChild(clip, way, float(clip == "clip3" and way == line), clip == "clip3")
        for clip in clips
        for way in (steer, line)
    ]
    assert ranked(clips, tried) == ["clip3", *(clip for clip in clips if clip != "clip3")]
    assert [halved(8, number) for number in range(1, 6)] == [8, 4, 2, 1, 1]
    ways = MutantDraws(tried * 3, np.random.default_rng(0))
    assert ways.choose("new", (steer, line)) == line
    assert {ways.choose("new", (steer, line)) for _ in range(40)} == {steer, line}, "what a clip had often waits"


def test_children_are_spread_over_the_rounds() -> None:
    assert spread(10, 3) == (4, 3, 3)
