"""The benchmark of seeded faults: harmless at 0, at work at 1; its figures, and one small search."""

from __future__ import annotations

import math
import os
import sys
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path

import pytest
from foresee_study.faults import plug_in_path
from foresee_study.faults.__main__ import FEW, listed
from foresee_study.faults.benchmark import all_kinds
from foresee_study.faults.causes import Named, causes_table
from foresee_study.faults.evidence import ApproachRun, Evidence, Failure
from foresee_study.faults.judgement import judgement_table, measure_judgement
from foresee_study.faults.measures import Confusion, confusions, detects, median, scores, weakest
from foresee_study.faults.sampling import library, name
from foresee_study.faults.searching import APPROACHES, DEFAULT_APPROACHES, Approach, Search, searched
from foresee_study.faults.table import Benchmark, as_json, as_markdown
from foresee_study.halves import Half, of_half

from foresee_dsl.campaign.driving import DriverSetup
from foresee_dsl.campaign.findings.diagnosing import Failing, diagnose
from foresee_dsl.campaign.keys import driver_identity
from foresee_dsl.campaign.settings import CampaignSettings
from foresee_dsl.compile import compile_test_case
from foresee_dsl.derive.presets import PRESETS
from foresee_dsl.drivers.consent import allow
from foresee_dsl.drivers.idm import IdmDriver
from foresee_dsl.drivers.parts import DriverPart
from foresee_dsl.drivers.pdm import PdmDriver
from foresee_dsl.drivers.protocol import Control, Mission, Observation, VehicleLimits
from foresee_dsl.drivers.registry import load_driver
from foresee_dsl.errors import DriverError
from foresee_dsl.forecast.registry import RANKERS
from foresee_dsl.language.document import TestCase
from foresee_dsl.simulate.runner import run

# The plug-in is found by way of the path: other tests list what is installed, so it is there for these tests alone.
sys.path.append(str(plug_in_path.PLUG_IN))
from foresee_faults.catalogue import KINDS
from foresee_faults.driver import FaultyDriver

sys.path.remove(str(plug_in_path.PLUG_IN))

ROOT = Path(__file__).parents[3]

CASES = (
    "scenario7.foresee::r04",
    "scenario9/side_streets.foresee::pickup_rolls_through_the_stop",
    "scenario8/stream_with_gaps.foresee::lorry_leads_in_the_rain",
    "scenario4/roundabout_exit.foresee::to_the_east",
)
"""Between them every kind finds something to spoil."""


@pytest.fixture(scope="module", autouse=True)
def plugged_in() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "path", list(sys.path))
        patch.setenv("PYTHONPATH", os.environ.get("PYTHONPATH", ""))
        plug_in_path.add_plug_in()
        yield


class Recording:
    """The healthy driver, and what it was told, saw and answered."""

    name, version = "recording", "1"

    def __init__(self) -> None:
        self.healthy = PdmDriver()
        self.steps: list[tuple[Observation, Control]] = []

    def reset(self, mission: Mission, vehicle: VehicleLimits, seed: int) -> None:
        self.told = mission, vehicle
        self.healthy.reset(mission, vehicle, seed)

    def step(self, observation: Observation) -> Control:
        seen = observation
        answer = self.healthy.step(seen)
        plain = Observation(seen.time_s, seen.ego, seen.actors, seen.signals, seen.measured_s)
        self.steps.append((plain, answer))
        return answer


@pytest.fixture(scope="module")
def bundled() -> list[TestCase]:
    return library()


@pytest.fixture(scope="module")
def drives(bundled: list[TestCase]) -> Mapping[str, Recording]:
    found = {}
    for case in bundled:
        if name(case) in CASES:
            found[name(case)] = recording = Recording()
            run(compile_test_case(case), recording, seed=0)
    return found


def differs(recording: Recording, kind: str, strength: float, steps: int | None = None) -> bool:
    """Whether a faulty driver, shown what the healthy one saw, ever answers otherwise (in the first so many steps)."""
    driver = FaultyDriver("pdm", kind, strength)
    driver.reset(*recording.told, 0)
    return any(driver.step(seen) != answer for seen, answer in recording.steps[:steps])


@pytest.mark.parametrize("kind", KINDS)
def test_a_fault_of_no_strength_changes_no_answer(kind: str, drives: Mapping[str, Recording]) -> None:
    for case in CASES[:2]:
        assert not differs(drives[case], kind, 0.0, steps=400)


@pytest.mark.parametrize("kind", KINDS)
def test_a_coarse_fault_changes_answers(kind: str, drives: Mapping[str, Recording]) -> None:
    assert any(differs(drives[case], kind, 1.0) for case in CASES)


@pytest.mark.parametrize("fault", [fault for fault in all_kinds(KINDS) if fault.startswith("idm/")])
def test_a_fault_of_no_strength_changes_no_answer_of_idm(fault: str, drives: Mapping[str, Recording]) -> None:
    recording = drives[CASES[0]]
    drivers = IdmDriver(), FaultyDriver("idm", fault.partition("/")[2], 0.0)
    for driver in drivers:
        driver.reset(*recording.told, 0)
    for seen, _ in recording.steps:
        answer, same = (driver.step(seen) for driver in drivers)
        assert answer == same


def test_there_are_enough_kinds_and_the_documentation_has_them() -> None:
    assert len(KINDS) >= 24
    assert listed(KINDS) in (ROOT / "docs" / "background" / "faults.md").read_text(encoding="utf-8")
    assert all(name.partition("/")[2] in KINDS for name in FEW)


def test_a_fault_is_named_by_driver_kind_and_strength() -> None:
    allow("fault:idm/weak_brakes@0.25")
    driver = load_driver("fault:idm/weak_brakes@0.25")
    assert (driver.name, driver.version) == ("idm with weak_brakes@0.25", "1")
    addresses = [f"fault:{text}" for text in ("pdm/weak_brakes@0.2", "pdm/weak_brakes@0.3", "idm/weak_brakes@0.2",
                                              "pdm/slow_brakes@0.2")]  # fmt: skip
    allow(*addresses)
    keys = {driver_identity(address) for address in addresses}
    assert len(keys) == 4


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "write DRIVER/KIND@STRENGTH"),
        ("pdm/weak_brakes", "write DRIVER/KIND@STRENGTH"),
        ("frenetix/weak_brakes@1", "pdm, idm"),
        ("pdm/bad_mood@1", "late_objects"),
        ("pdm/weak_brakes@2", "from 0 to 1"),
        ("pdm/weak_brakes@nan", "from 0 to 1"),
        ("pdm/weak_brakes@much", "from 0 to 1"),
    ],
)
def test_what_names_no_fault_is_refused_with_what_to_write(text: str, says: str) -> None:
    allow(f"fault:{text}")
    with pytest.raises(DriverError, match=says):
        load_driver(f"fault:{text}")


# ---- figures --------------------------------------------------------------------------------------------------------


def failure(finding: str, *, own: bool, **verdicts: bool | None) -> Failure:
    return Failure(("7", finding), finding, "case", "pass" if own else "F4", verdicts)


def evidence(approach: str, *runs: tuple[float, Failure | None], strength: float = 0.4) -> Evidence:
    return Evidence("pdm/x", strength, approach, tuple(ApproachRun("child", s, found) for s, found in runs), 1.0)


@pytest.mark.parametrize(("from_", "tries"), [(0.1, 3), (0.2, 3), (0.4, 3), (0.7, 2), (1.0, 3), (2.0, 3)])
def test_the_weakest_strength_is_bisected_from_the_middle(from_: float, tries: int) -> None:
    strengths, asked = (0.1, 0.2, 0.4, 0.7, 1.0), []

    def finds(strength: float) -> bool:
        asked.append(strength)
        return strength >= from_

    assert weakest(strengths, finds) == (from_ if from_ <= 1 else math.inf)
    assert asked[0] == 0.4 and len(asked) <= tries


def test_precision_recall_and_the_first_at_equal_simulated_time() -> None:
    one = evidence("one", (10, None), (10, failure("a", own=False)), (10, failure("b", own=True)),
                   (10, failure("b", own=False)), (10, failure("c", own=True)))  # fmt: skip
    two = evidence("two", (10, None), (30, failure("c", own=True)))
    found = scores([one, two], 45)
    assert (found["one"].failing, found["one"].the_faults, found["one"].precision) == (4, 2, 0.5)
    assert (found["one"].findings, found["one"].true_findings) == (3, 2)
    assert (found["one"].first_s, found["two"].first_s) == (30, 40)
    assert (found["one"].recall, found["two"].recall) == (1.0, 0.5)
    cut = scores([one, two], 20)  # a run counts that begins before
    assert (cut["one"].failing, cut["one"].the_faults, cut["one"].first_s) == (1, 0, math.inf)
    assert (cut["one"].recall, cut["two"].recall) == (0.0, 1.0)
    assert detects(two, 11) and not detects(two, 10)
    nothing = scores([evidence("none", (10, None))], 45)["none"]
    assert nothing.precision is None and nothing.recall is None and nothing.simulated_s == 10


def test_a_verdict_is_right_where_the_healthy_driver_passes_what_it_calls_avoidable() -> None:
    found = confusions([
        failure("a", own=True, one=True, two=None), failure("a", own=True, one=False, two=True),
        failure("a", own=False, one=False, two=False), failure("a", own=False, one=True),
        failure("a", own=False, one=False),
    ])  # fmt: skip
    assert found["one"] == Confusion(1, 1, 2, 1, 0) and found["two"] == Confusion(1, 0, 1, 1, 1)
    assert found["one"].balanced == pytest.approx((1 / 2 + 2 / 3) / 2) and found["two"].precision == 1
    assert confusions([failure("a", own=True, one=True)])["one"].balanced is None


def test_medians_leave_out_what_is_unknown_and_count_what_is_never_found() -> None:
    assert median([0.1, None, 0.4, math.inf]) == 0.4
    assert median([0.1, math.inf, math.inf]) == math.inf
    assert median([None]) is None


# ---- test cases and approaches --------------------------------------------------------------------------------------


def test_halves_are_apart_and_small_samples_have_all_families(bundled: list[TestCase]) -> None:
    names = [name(case) for case in bundled]
    even = {name(case) for case in of_half(bundled, Half.EVEN)}
    assert len(names) == len(set(names)) and even < set(names) and 40 < len(even) < len(names) - 40
    assert len({case.family for case in bundled[:10]}) == len({case.family for case in bundled})


def test_every_approach_is_a_campaign_that_this_version_can_run() -> None:
    assert all(name in APPROACHES for name in DEFAULT_APPROACHES)
    for approach in APPROACHES.values():
        settings = replace(CampaignSettings(), **(approach.settings or {}))
        assert settings.ranker in RANKERS.names() and settings.preset in PRESETS


# ---- a search -------------------------------------------------------------------------------------------------------


def test_a_search_ends_with_its_time_and_is_not_done_twice(bundled: list[TestCase], tmp_path: Path) -> None:
    case = next(case for case in bundled if name(case) == "scenario7.foresee::r01")
    search = Search("pdm/weak_brakes", 1.0, Approach("foresee", {"risky_points": 1}), 40.0)
    found = searched(search, [case], tmp_path)
    assert [run.kind for run in found.runs[:3]] == ["seed", "clip", "child"]
    spent = [run.simulated_s for run in found.runs]
    assert sum(spent[:-1]) < 40.0
    assert all(run.failure.healthy and "R157" in run.failure.verdicts for run in found.runs if run.failure)
    file = next(tmp_path.rglob("foresee.json"))
    assert not list(tmp_path.rglob("*.work"))
    before = file.stat().st_mtime_ns
    assert searched(search, [case], tmp_path) == found and file.stat().st_mtime_ns == before
    other = Search("pdm/weak_brakes", 1.0, search.approach, 10.0)
    assert other.key([case]) != search.key([case])
    written = Benchmark(("foresee",), ("pdm/weak_brakes",), (1.0,), 1.0, 40.0, {("pdm/weak_brakes", "foresee"): 1.0},
                        (found,), (), {"pdm/weak_brakes": 1}, "all", 1.0)  # fmt: skip
    assert "| foresee | 1 | 1 of 1 |" in as_markdown(written)
    assert as_json(written)["faults"][0]["approaches"][0]["failing"] == len(found.failures(40.0))


def test_a_diagnosis_names_the_part_with_the_fault(bundled: list[TestCase]) -> None:
    case = next(case for case in bundled if name(case) == "scenario7.foresee::r04")
    driver = plug_in_path.address("pdm/late_objects", 1.0)
    (result,) = diagnose([Failing(name(case), case, DriverSetup(driver))])
    assert result.diagnosis is not None
    assert result.diagnosis.cause == (KINDS["late_objects"].part,) == (DriverPart.PERCEPTION,)
    table = causes_table([Named("pdm/late_objects", name(case), "perception", "perception", result.diagnosis.text)])
    assert "| perception | 1 |" in table and "Right: 1 of 1" in table


def test_the_judgement_is_compared_with_steady_labels(bundled: list[TestCase], tmp_path: Path) -> None:
    case = next(case for case in bundled if name(case).endswith("at_the_tee.foresee::hatchback_out_of_elm_street"))
    lines: list[str] = []
    failures = measure_judgement([case], ["pdm/beside_itself", "pdm/weak_brakes"], (1.0,), out=tmp_path, jobs=1,
                                 ends_s=math.inf, say=lines.append)  # fmt: skip
    assert len(lines) == len(failures) and {bool(each.fault) for each in failures} == {True, False}
    all_of_them, steady = judgement_table(failures).splitlines()[2:]
    count = sum(bool(each.fault) for each in failures)
    assert f" of {count} |" in all_of_them and steady.startswith("| with steady labels |")
