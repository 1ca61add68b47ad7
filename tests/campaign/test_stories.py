"""Children that go where they may add a story: the same for any workers, two levels, and earlier failures first."""

from __future__ import annotations

import re
import shutil
from dataclasses import replace
from pathlib import Path

import pytest

from foresee_dsl.campaign.allocation.adaptive import Adaptive
from foresee_dsl.campaign.allocation.draws import ChildFacts, ClipGroup, DrawMethod, PastChild
from foresee_dsl.campaign.allocation.earlier import EarlierMutants
from foresee_dsl.campaign.allocation.rounds import METHODS
from foresee_dsl.campaign.allocation.stories import Archive, Estimates, Stories
from foresee_dsl.campaign.driving import DriverSetup
from foresee_dsl.campaign.findings.named_failure import find_failure
from foresee_dsl.campaign.findings.review import review_of
from foresee_dsl.campaign.plan import plan_campaign
from foresee_dsl.campaign.regression.keeping import keep, source_of
from foresee_dsl.campaign.results import CampaignResult
from foresee_dsl.campaign.stages import Stages
from foresee_dsl.campaign.storage.store import Store
from foresee_dsl.campaign.workers.pool import RunOptions
from foresee_dsl.derive.local_search import WEAKER, weaker_changes
from foresee_dsl.derive.mutate import How
from foresee_dsl.errors import ForeseeError
from foresee_dsl.language.model import Change, Mutant, Quantity
from foresee_dsl.language.parser import parse
from foresee_dsl.language.project.expand import expanded_text
from foresee_dsl.language.project.loading import load_test_case, load_test_cases
from foresee_dsl.report.page.html import write_report
from foresee_dsl.report.page.markdown import write_markdown
from foresee_dsl.report.safe_text import counted
from tests.campaign.test_allocation import HeardRounds
from tests.support.command import foresee
from tests.support.small_campaign import SETTINGS, campaign, published, write_project

STORIES = replace(SETTINGS, allocation="stories")


@pytest.fixture(scope="module")
def done(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path, CampaignResult, HeardRounds]:
    """A project, the folder of its campaign with two workers, its result, and what was heard."""
    root = tmp_path_factory.mktemp("stories")
    file, heard = write_project(root / "project"), HeardRounds()
    result, _ = campaign(file, root / "out", STORIES, options=RunOptions(jobs=2), heard=heard)
    return file, root / "out", result, heard


def test_one_worker_that_is_stopped_between_gives_the_same(
    done: tuple[Path, Path, CampaignResult, HeardRounds],
) -> None:
    file, out, _, first = done
    mine = out.with_name("one_worker")
    stopped = HeardRounds(stops=True)
    result, _ = campaign(file, mine, STORIES, options=RunOptions(stop=stopped.stop), heard=stopped)
    assert result.interrupted and 0 < len(stopped.rounds) < Stories.rounds - 1
    again = HeardRounds()
    campaign(file, mine, STORIES, heard=again)
    assert again.rounds == first.rounds
    assert published(mine) == published(out)


def test_there_are_as_many_children_as_with_even_and_each_says_why_it_was_made(
    done: tuple[Path, Path, CampaignResult, HeardRounds],
) -> None:
    file, out, result, heard = done
    data = published(out)["json"]
    children = {child["mutant"]: child for clip in data["clip_runs"] for child in clip["children"]}
    assert len(children) == STORIES.children * len(data["clip_runs"])
    assert all(child["why"] for child in children.values())
    assert [begun.number for begun in heard.rounds] == [2, 3, 4]
    with Store(out / "store", write=False) as store:
        plan = plan_campaign(Stages(load_test_cases([file]), STORIES, store, out), store, jobs=1)
    assert plan.allocation is not None and Stories.words in plan.allocation.sentence
    assert plan.runs_to_do == (0, 0)
    finding = result.findings[0]
    why = children[finding.name]["why"]
    mutant = parse((out / finding.file).read_text(), "mutant").model
    assert isinstance(mutant, Mutant) and mutant.origin is not None and mutant.origin.why == why
    review = review_of(find_failure(finding.name, out))
    assert review.why == why
    assert not [command for command in review.command_lines if "--run-programs" in command]
    program = replace(review.campaign.settings, driver="external:python3 my_driver.py")
    review = replace(review, campaign=replace(review.campaign, settings=program))
    asks = {command.split()[1] for command in review.command_lines if command.endswith(" --run-programs")}
    assert asks == {"verify", "sure"}, "files name the driver, so these ask for consent"
    write_report([out], out / "report.html")
    write_markdown([out], out / "report.md")
    for page in ("report.html", "report.md"):
        assert why.split(":")[0] in (out / page).read_text(encoding="utf-8")


def test_a_child_that_came_near_is_forecast_and_gets_a_further_change(
    done: tuple[Path, Path, CampaignResult, HeardRounds], tmp_path: Path
) -> None:
    file, out, result, _ = done
    clip, child = next((clip, child) for clip in result.clips for child in clip.children if child.name.count("_m") == 2)
    base = next(other for other in clip.children if other.name == child.drawn_near)
    assert child.name.startswith(f"{base.name}_m") and base.verdict.value == "pass"
    assert child.changes[: len(base.changes)] == base.changes and len(child.changes) > len(base.changes)
    assert base.name in child.why and "a change added" in child.why
    # It is a file like any other mutant's: it needs only its clip, and gives the recorded run.
    folder = tmp_path / "project" / "mutants"
    shutil.copytree(file.parent, tmp_path / "project")
    folder.mkdir()
    text = next(out.rglob(f"children/**/{clip.name}.foresee")).read_text() if clip.failing else clip.text
    path = text.splitlines()[2].split('"')[1]
    (folder / f"{clip.name}.foresee").write_text(text.replace(f'"{path}"', '"../crosser.foresee"'))
    mutant = folder / f"{child.name}.foresee"
    mutant.write_text(child.text)
    case = load_test_case(mutant)
    assert DriverSetup("idm", STORIES.seed, ends_early=True).run(case).trace.digest == child.digest
    assert child.name in expanded_text(case)


def test_failures_of_an_earlier_campaign_are_run_first(
    done: tuple[Path, Path, CampaignResult, HeardRounds], tmp_path: Path
) -> None:
    file, out, result, _ = done
    failing = {child.name: child for clip in result.clips for child in clip.failing}
    assert failing
    first = replace(SETTINGS, children=2, first_from=out.as_posix())
    shutil.copytree(out / "store", tmp_path / "store")
    for allocation in ("even", "stories"):
        settings = replace(first, allocation=allocation)
        again, heard = campaign(file, tmp_path / allocation, settings, store=tmp_path / "store")
        assert heard.count("clip") == 0, "clips are shared"
        children = [child for clip in again.clips for child in clip.children]
        tried = [child for child in children if "failed in this test case" in child.why]
        assert {child.name.rpartition("_m")[2] for child in tried} == {"1"}
        assert all(child.verdict.is_failure for child in tried)
        assert len(children) == 2 * len(again.clips)
    with pytest.raises(ForeseeError, match="the folder of this campaign"):
        campaign(file, out, replace(STORIES, first_from=out.as_posix()))
    with pytest.raises(ForeseeError, match="no folder"):
        campaign(file, tmp_path / "other", replace(STORIES, first_from="nowhere"))
    with pytest.raises(ForeseeError, match="no failing mutants"):
        campaign(file, tmp_path / "other", replace(STORIES, first_from=file.parent.as_posix()))


def test_kept_failures_are_earlier_failures(
    done: tuple[Path, Path, CampaignResult, HeardRounds], tmp_path: Path
) -> None:
    _, out, result, _ = done
    failing = next(child for clip in result.clips for child in clip.failing)
    keep([source_of(failing.name, out, full=True)], tmp_path / "kept")
    earlier = EarlierMutants.in_folder(tmp_path / "kept", but=out)
    clip = next(clip for clip in result.clips if failing in clip.failing)
    (request,) = earlier.requests(clip.text)
    assert parse(request.near, "x").model.changes == parse(failing.text, "x").model.changes


def test_earlier_failures_of_other_test_cases_are_counted(
    done: tuple[Path, Path, CampaignResult, HeardRounds], tmp_path: Path
) -> None:
    file, out, result, _ = done
    failing = sum(len(clip.failing) for clip in result.clips)
    assert EarlierMutants.in_folder(out, but=tmp_path).left_out(load_test_cases([file])) == 0
    other = write_project(tmp_path / "project")
    other.write_text(other.read_text().replace("speed 40 km/h", "speed 41 km/h"))
    options = ("--driver", "idm", "--first-from", out, "--out", tmp_path / "out", "--store", tmp_path / "store")
    plan = foresee("plan", other, *options, env={"COLUMNS": "500"}).stdout
    assert f"not run first: {failing} of {counted(failing, 'failing mutant')} in {out.as_posix()} belong" in plan, plan
    assert "failing mutant" not in foresee("plan", file, *options).stdout


def test_a_folder_from_elsewhere_is_not_left(
    done: tuple[Path, Path, CampaignResult, HeardRounds], tmp_path: Path
) -> None:
    """A mutant of a received folder must not make the tool read another file of this machine."""
    _, out, result, _ = done
    failing = next(child for clip in result.clips for child in clip.failing)
    (tmp_path / "private.foresee").write_text("a secret")
    (tmp_path / "received").mkdir()
    text = re.sub(r'of "[^"]+"', 'of "../private.foresee"', failing.text)
    (tmp_path / "received" / "m.foresee").write_text(text)
    with pytest.raises(ForeseeError, match="lies outside") as error:
        EarlierMutants.in_folder(tmp_path / "received", but=out)
    assert "secret" not in str(error.value)


def past(clip: str, story: str = "", *, avoided: bool = False, way: str = "steer", rank: int = 1) -> PastChild:
    facts = ChildFacts((story,) if story else (), avoidable=avoided, nearness=0.0)
    return PastChild(clip, ClipGroup("3", rank), DrawMethod((way,)), facts, avoided)


def test_a_cell_is_a_story_and_remembers_whether_it_is_avoidable() -> None:
    archive = Archive()
    assert archive.add(past("a", "rear end")) and archive.unavoided("a")
    assert not archive.add(past("b", "rear end", avoided=True))
    assert not archive.unavoided("a") and archive.cells == {("rear end",): True}


def test_what_failed_before_gains_less_than_what_may_still_add_a_story() -> None:
    steer, timing = DrawMethod(("steer",)), DrawMethod(("timing",))
    group = ClipGroup("3", 1)
    seen = [past("often", "rear end", avoided=True) for _ in range(6)] + [past("never") for _ in range(2)]
    estimates = Estimates(seen)
    assert estimates.fails("often", group, steer) > estimates.fails("never", group, steer)
    assert estimates.gain("often", group, steer).value < estimates.gain("new", group, steer).value
    assert estimates.gain("never", group, timing).value > estimates.gain("never", group, steer).value, "not tried there"
    before = estimates.gain("new", group, timing).value
    estimates.expect("new", timing, 0.5)
    assert estimates.gain("new", group, timing).value < before, "what was given out counts at once"
    ranks = Estimates([past(f"c{k}", "x" if k < 5 else "", rank=1 if k < 10 else 2) for k in range(20)])
    assert ranks.fails("new", ClipGroup("3", 1), steer) > ranks.fails("new", ClipGroup("3", 2), steer)
    known = Estimates([past("a", "rear end"), past("b", "turning", avoided=True)])
    weaker = DrawMethod(("steer",), How.WEAKER)
    assert known.gain("a", group, weaker, of_known=True).value > known.gain("b", group, weaker, of_known=True).value, (
        "the failure of a may become avoidable"
    )


def test_weaker_changes_have_a_share_of_the_strength() -> None:
    change = Change(actor="other", property="timing", was=Quantity.of(1, "ratio", 2), now=Quantity.of(1.4, "ratio", 2))
    values = [weaker_changes((change,), turn) for turn in range(len(WEAKER))]
    assert [changes[0].now.si for changes in values if changes and isinstance(changes[0].now, Quantity)] == (
        [pytest.approx(1 + 0.4 * share) for share in WEAKER]
    )
    assert weaker_changes((change,), len(WEAKER)) is None
    swap = Change(actor="other", property="model", was="car.compact", now="car.sports")
    assert weaker_changes((swap,), 0) is None


def test_each_allocation_in_rounds_is_one_class() -> None:
    assert {name: type(method) for name, method in METHODS.items()} == {"adaptive": Adaptive, "stories": Stories}
