"""DriveFuzz on a small crossing: cycles, scores, files that run again, and a process that is killed."""

from __future__ import annotations

import json
import math
import signal
import sqlite3
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pytest
from foresee_study.fuzz.engine import fuzz
from foresee_study.fuzz.folder import case_results
from foresee_study.fuzz.mutation import Mutator
from foresee_study.fuzz.quality import Quality, quality_of
from foresee_study.fuzz.records import FuzzResult
from foresee_study.fuzz.settings import FARTHEST_M, NEAREST_M, FuzzSettings
from foresee_study.fuzz.texts import file_text, original_of, text_of

from foresee_dsl.campaign.driving import run_test_case
from foresee_dsl.campaign.storage.store import Store
from foresee_dsl.campaign.workers.pool import RunOptions
from foresee_dsl.compile import compile_test_case
from foresee_dsl.derive.clipping.clip import clip
from foresee_dsl.errors import ForeseeError
from foresee_dsl.language.checked_files import check_paths
from foresee_dsl.language.parser import format_text
from foresee_dsl.language.project.expand import expand_clip
from foresee_dsl.language.project.loading import Project, load_test_case, load_test_cases
from foresee_dsl.report.builds.case_results import BuildOutcome
from foresee_dsl.simulate.results.verdict import Verdict
from foresee_dsl.simulate.trace import ACCELERATION, STEER, YAW_RATE
from tests.support.handmade_traces import EAST, make_trace, straight
from tests.support.situations import risky
from tests.support.small_campaign import InThisProcess, write_project

SETTINGS = FuzzSettings(driver="idm", cycles=2, mutations=3, seed=4)


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_project(tmp_path_factory.mktemp("fuzz"))


@pytest.fixture(scope="module")
def done(file: Path) -> tuple[FuzzResult, Path]:
    """Two seeds, fuzzed by two workers."""
    out = file.parent / "out"
    with Store(out / "store") as store:
        cases = load_test_cases([f"{file}::after", f"{file}::last"])
        return fuzz(cases, SETTINGS, out=out, store=store, options=RunOptions(jobs=2)), out


def written(out: Path) -> dict[str, Any]:
    """What has to be the same for the same results."""
    data = json.loads((out / "fuzz.json").read_text())
    files = {str(f.relative_to(out)): f.read_bytes() for f in sorted((out / "mutated").rglob("*.foresee"))}
    return {"json": {**data, "wall_s": 0}, "files": files}


def test_cycles_go_on_from_the_worst_drive_and_a_failure_ends_its_seed(
    done: tuple[FuzzResult, Path], root: Path
) -> None:
    result, out = done
    assert [seed.verdict for seed in result.seeds] == [Verdict.PASS] * 2
    assert result.failures > 0, "choose another seed: the test needs a failure"
    for seed in result.seeds:
        failures = [run for run in seed.every if run.outcome.verdict.is_failure]
        assert failures in ([], [seed.every[-1]])
        for number, cycle in enumerate(seed.cycles):
            assert [run.number for run in cycle.runs] == list(range(1, len(cycle.runs) + 1))
            if not cycle.chosen:
                assert cycle is seed.cycles[-1] and seed.failed is cycle.runs[-1]
                continue
            chosen = cycle.runs[cycle.chosen - 1]
            assert chosen.score == min(run.score for run in cycle.runs if run.outcome.verdict is not Verdict.INVALID)
            for child in seed.cycles[number + 1].runs if number + 1 < len(seed.cycles) else ():
                more = set(child.outcome.lines.split("\n")) - set(chosen.outcome.lines.split("\n"))
                assert more, f"{child.name} changes nothing of {chosen.name}"
    assert result.by_cycle[0].seeds == 2
    schema = json.loads((root / "docs" / "schemas" / "fuzz-1.json").read_text())
    jsonschema.validate(json.loads((out / "fuzz.json").read_text()), schema)
    assert sum(one.failures for one in result.by_cycle) == result.failures


def test_build_servers_get_each_run_and_fail_as_the_command_does(done: tuple[FuzzResult, Path]) -> None:
    result, out = done
    results = case_results(result, out)
    failed = {one.name for one in results if one.outcome is not BuildOutcome.PASSED}
    ends = (Verdict.TIMEOUT, Verdict.CRASH)
    every = [run for seed in result.seeds for run in seed.every]
    assert failed == {run.name for run in every if run.outcome.verdict.is_failure or run.outcome.verdict in ends}
    assert len(results) == len(result.seeds) + sum(run.outcome.verdict is not Verdict.INVALID for run in every)
    first = next(one for one in results if one.name in failed)
    assert first.suite.endswith(".foresee") and first.place.path == first.reproduce.split()[2].partition("::")[0]
    assert first.place.span is not None and first.reproduce.endswith(" --rules off")


def test_files_check_are_formatted_and_run_again_to_the_same_verdict(done: tuple[FuzzResult, Path]) -> None:
    result, out = done
    runs = [run for seed in result.seeds for run in seed.every if run.outcome.lines]
    files = sorted((out / "mutated").rglob("*.foresee"))
    assert files == sorted(out / run.file for run in runs)
    assert not check_paths([str(one) for one in files]).diagnostics
    for one in files:
        assert format_text(one.read_text(), str(one)) == one.read_text()
    failed = next(seed.failed for seed in result.seeds if seed.failed is not None)
    for run in (failed, next(run for run in runs if run.outcome.verdict is Verdict.PASS)):
        again = run_test_case(load_test_case(out / run.address), "idm", SETTINGS.seed)
        assert (again.verdict, again.reason, again.trace.digest) == (
            run.outcome.verdict,
            run.outcome.reason,
            run.outcome.digest,
        )


def test_a_fuzzing_that_is_killed_goes_on_to_the_same_bytes_with_another_number_of_workers(
    file: Path, done: tuple[FuzzResult, Path]
) -> None:
    out = file.parent / "killed"
    words = ["fuzz", f"{file}::after", f"{file}::last", "--driver", "idm", "--cycles", "2", "--mutations", "3"]
    process = subprocess.Popen(
        [sys.executable, "-m", "foresee_dsl", *words, "--seed", "4", "--jobs", "1", "--out", str(out), "--quiet"],
        stdout=subprocess.DEVNULL,
    )
    while rows(out) < 4 and process.poll() is None:
        time.sleep(0.02)
    assert process.poll() is None, "it ended before it could be killed"
    process.send_signal(signal.SIGKILL)
    process.wait()
    known = rows(out)
    assert not (out / "fuzz.json").exists()
    with Store(out / "store") as store:
        cases = load_test_cases([f"{file}::after", f"{file}::last"])
        fuzz(cases, SETTINGS, out=out, store=store, options=RunOptions(executor=InThisProcess))
    assert rows(out) > known
    assert written(out) == written(done[1])


def rows(out: Path) -> int:
    """How many results are in the store of a folder."""
    try:
        with sqlite3.connect((out / "store" / "runs.sqlite").resolve().as_uri() + "?mode=ro", uri=True) as database:
            return int(database.execute("SELECT count(*) FROM runs").fetchone()[0])
    except sqlite3.OperationalError:
        return 0


def test_draws_are_near_free_and_read_back(file: Path) -> None:
    case = load_test_case(f"{file}::after")
    bundle, seed = compile_test_case(case), original_of(case)
    ego, kinds = bundle.scene.ego, set[str]()
    for number in range(40):
        rng = np.random.Generator(np.random.PCG64(number))
        mutated = Mutator(case, case, (), bundle, rng).all_changes()
        if mutated is None:
            continue
        target = file.parent / "drawn.foresee"
        text = file_text("drawn", seed, target, text_of(mutated.lines))
        found = Project(overlay={target: text}).test_case(f"{target}::after")
        scene = compile_test_case(found).scene  # which refuses who overlaps, and who is in a building
        (name,) = mutated.added
        added = next(actor for actor in scene.actors if actor.id == name)
        away = math.hypot(added.x - ego.x, added.y - ego.y)
        assert NEAREST_M - added.model.length_m <= away <= FARTHEST_M + added.model.length_m
        assert found.scenario.body != case.scenario.body
        kinds.add(added.model.kind)
        for patch in scene.slippery:
            assert math.hypot(patch.x - ego.x, patch.y - ego.y) <= FARTHEST_M + 1
    assert {"car", "pedestrian", "bicycle"} <= kinds


def test_the_score_counts_what_was_hard() -> None:
    ego = straight("car", 0.0, 0.0, EAST, 10.0)
    other = straight("car", 0.0, 6.0, EAST, 10.0)
    calm = quality_of(make_trace({"ego": ego, "other": other}))
    width = make_trace({"ego": ego}).actors[0].width_m
    assert calm.nearness == pytest.approx(1 / (6.0 - width), abs=0.01)
    assert calm.score == pytest.approx(-calm.nearness)
    states = ego.states
    states[10:13, ACCELERATION] = -7.0
    states[20:22, ACCELERATION] = 6.0
    states[30:35, YAW_RATE] = 0.5  # 5 m/s^2 at 10 m/s
    states[50:54, STEER] = 0.1  # and it goes straight on
    hard = quality_of(make_trace({"ego": ego, "other": other}))
    assert (hard.hard_braking, hard.hard_acceleration, hard.hard_turning, hard.understeer) == (3, 2, 5, 4)
    assert hard.oversteer == 5
    assert hard.score == pytest.approx(-(3 + 2 + 5 + 4 + 5) - hard.nearness)


def test_each_frame_of_each_kind_counts_one_in_the_score() -> None:
    for kind in ("hard_acceleration", "hard_braking", "hard_turning", "oversteer", "understeer"):
        assert Quality(**{kind: 3}).score == -3
    assert Quality(nearness=0.5).score == -0.5


def test_a_slow_ego_does_not_understeer() -> None:
    ego = straight("car", 0.0, 0.0, EAST, 1.0)
    ego.states[50:54, STEER] = 0.1
    assert quality_of(make_trace({"ego": ego})).understeer == 0


def test_clips_and_mutants_are_no_seeds(file: Path, tmp_path: Path) -> None:
    case = load_test_case(f"{file}::after")
    trace = run_test_case(case, "idm", 0).trace
    made = clip(case, trace, risky(trace, "other", 3.0), before_s=2, after_s=1, name="c", parent=file.name)
    with pytest.raises(ForeseeError, match="only scenarios can be extended"):
        original_of(expand_clip(made, case, source=tmp_path / "c.foresee"))
