"""The classes of steps: found by themselves, in order, and each known wherever steps are told apart."""

from __future__ import annotations

import inspect
from typing import get_args

from foresee_dsl.campaign.execution.preloading import MODULES
from foresee_dsl.campaign.records import Record, Repeats
from foresee_dsl.campaign.settings import CampaignSettings
from foresee_dsl.campaign.stages import STEPS


def test_each_follows_from_the_one_before_it() -> None:
    assert [(step.kind, step.follows) for step in STEPS] == [
        ("seed", ""),
        ("case_reference", "seed"),
        ("forecast", "seed"),
        ("clip", "forecast"),
        ("mutants", "clip"),
        ("child", "mutants"),
        ("check", "child"),
        ("reference", "child"),
        ("minimise", "child"),
        ("minimised_reference", "minimise"),
    ]
    assert {step.reads for step in STEPS} <= {"", *(step.kind for step in STEPS if step.drives)}
    assert not any(inspect.isabstract(step) for step in STEPS)


def test_each_has_a_record_that_the_assembly_knows() -> None:
    """`assembly.assemble` is checked against the union by mypy."""
    assert {step.record for step in STEPS} == set(get_args(Record)) - {Repeats}  # findings are repeated after the steps


def test_workers_start_with_all_of_them_imported() -> None:
    assert {step.__module__ for step in STEPS} <= set(MODULES)


def test_what_may_follow_is_counted() -> None:
    settings = CampaignSettings(risky_points=3, children=5, repeat=2, against=("pdm", "idm+ideal"))
    assert [step.at_most(settings) for step in STEPS] == [0, 2, 1, 3, 2, 5, 0, 2, 1, 2]
