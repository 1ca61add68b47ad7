"""A store that was filled by something else than this command: another version, or one that gave runs less time."""

from __future__ import annotations

import shutil
import sqlite3
import time
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import pytest
from typer.testing import CliRunner

from foresee_dsl.campaign import keys
from foresee_dsl.campaign.settings import CampaignLimits
from foresee_dsl.campaign.storage.maintenance import sweep
from foresee_dsl.campaign.storage.store import Store
from foresee_dsl.campaign.workers.pool import RunOptions, Task, WorkerPool
from foresee_dsl.cli import app
from tests.support.small_campaign import SMALL, campaign, published, write_project

OPTIONS = (*SMALL, "--driver", "idm", "--before", "3", "--after", "3", "--risky-points", "2")
WHOLE = [3, 3, 3, 3, 12]
"""Test cases, forecasts, clips, mutations and children of the small campaign."""
KINDS = ("seed", "forecast", "clip", "mutants", "child")


def hang(_: object) -> None:
    time.sleep(1000)


class Hanging(WorkerPool):
    """Worker processes in which nothing comes to an end."""

    def add(self, tasks: Iterable[Task], priority: tuple[int, ...] = ()) -> None:
        super().add((replace(task, function=hang) for task in tasks), priority)


def given(deadline_s: float | None, pool: type[WorkerPool] = WorkerPool) -> RunOptions:
    return RunOptions(jobs=2, limits=CampaignLimits(deadline_s), executor=lambda how: pool(how.jobs))


def test_a_run_that_took_too_long_runs_again_when_it_gets_more_time_and_not_before(tmp_path: Path) -> None:
    file, out = write_project(tmp_path / "project"), tmp_path / "out"
    result, heard = campaign(file, out, options=given(0.3, Hanging))
    assert [seed.verdict for seed in result.seeds] == ["timeout"] * 3
    for again in (0.3, 0.2):
        result, heard = campaign(file, out, options=given(again))
        assert heard.kinds == [] and len(result.seeds) == 3
    result, heard = campaign(file, out, options=given(0.4, Hanging))
    assert heard.kinds == ["seed"] * 3
    assert all("longer than 0.4 s" in seed.reason for seed in result.seeds)
    _, heard = campaign(file, out, options=given(None))
    assert [heard.count(kind) for kind in KINDS] == WHOLE
    whole = published(out)
    _, heard = campaign(file, out, options=given(0.1))
    assert heard.kinds == [], "what ended in time stays, however little time there is now"
    assert published(out) == whole


@pytest.fixture(scope="module")
def left_by_older(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A finished campaign's folder, `out`, as version 0.0.9 would have left it, beside `project`."""
    folder = tmp_path_factory.mktemp("older")
    file = write_project(folder / "project")
    with pytest.MonkeyPatch.context() as earlier:
        earlier.setattr(keys, "__version__", "0.0.9")
        campaign(file, folder / "out", options=RunOptions(jobs=2))
    with sqlite3.connect(folder / "out" / "store" / "runs.sqlite") as database:
        database.execute("UPDATE runs SET tool = '0.0.9', sum = ''")
    database.close()
    return folder


@pytest.fixture
def older(left_by_older: Path, tmp_path: Path) -> Path:
    """The same, in a folder of the test's own."""
    shutil.copytree(left_by_older, tmp_path, dirs_exist_ok=True)
    return tmp_path


def test_another_versions_results_are_kept_and_not_taken_and_it_is_said_what_to_do(older: Path) -> None:
    file, out = older / "project" / "crosser.foresee", older / "out"
    before = published(out)
    with Store(out / "store", write=False) as store:
        theirs = {row.key for row in store.rows()}
    said = CliRunner().invoke(app, ["plan", str(file), *OPTIONS, "--out", str(out)], env={"COLUMNS": "300"})
    assert f"{len(theirs)} results in" in said.stdout and "of another version of foresee-dsl" in said.stdout
    assert f"foresee store gc {out / 'store'} --older" in said.stdout.replace("\n", "")
    _, heard = campaign(file, out, options=RunOptions(jobs=2))
    assert [heard.count(kind) for kind in KINDS] == WHOLE
    assert published(out)["traces"] == before["traces"]
    with Store(out / "store") as store:
        assert theirs < {row.key for row in store.rows()}
        assert store.of_other_versions() == len(theirs)
        assert sweep(store, older=True).rows == len(theirs)
        assert store.of_other_versions() == 0
    _, heard = campaign(file, out)
    assert heard.kinds == []


def test_the_command_says_it_too_and_only_when_it_is_so(older: Path) -> None:
    file, out = older / "project" / "crosser.foresee", older / "out"
    arguments = ["campaign", str(file), *OPTIONS, "--out", str(out), "--children", "0", "--quiet", "--exit-zero"]
    said = CliRunner().invoke(app, arguments, env={"COLUMNS": "300"})
    with Store(out / "store") as store:
        old = store.of_other_versions()
        sweep(store, older=True)
    assert said.exit_code == 0 and old > 24 and f"{old} results in" in said.stdout
    said = CliRunner().invoke(app, arguments, env={"COLUMNS": "300"})
    assert said.exit_code == 0 and "another version" not in said.stdout


def test_a_store_of_another_layout_is_refused_by_every_command_with_what_to_do(older: Path) -> None:
    file, out = older / "project" / "crosser.foresee", older / "out"
    for schema, what in ((2, "use that version"), (0, "move it away")):
        with sqlite3.connect(out / "store" / "runs.sqlite") as database:
            database.execute(f"PRAGMA user_version = {schema}")
            database.execute("PRAGMA application_id = 0")
        database.close()
        for command in ("plan", "campaign"):
            said = CliRunner().invoke(app, [command, str(file), *OPTIONS, "--out", str(out)])
            assert said.exit_code == 1
            message = str(said.exception)
            assert what in message and "--store" in message and "nothing was changed" in message
