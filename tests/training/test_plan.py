"""What is recorded: other cases than the bundled ones, drives through other towns, the same for any number of jobs."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from foresee_dsl.compile import compile_test_case
from foresee_dsl.language.project.loading import Project, load_test_case
from training.plan import bundled_meanings, drawn_cases, loaded, plan
from training.record import Job, record_all, record_piece
from training.towns import CARLA_HELD_OUT, drive, generate, town_names


def test_no_drawn_case_means_what_a_bundled_one_does(scenarios: Path, tmp_path: Path) -> None:
    found = drawn_cases(tmp_path, 4, 1, scenarios)
    assert sorted(found) == ["3", "4", "7", "8", "9"]
    project, known = Project(), bundled_meanings(scenarios)
    addresses = [address for of_family in found.values() for address in of_family]
    meanings = {project.test_case(address).meaning for address in addresses}
    assert len(meanings) == len(addresses) >= 31
    assert not meanings & known
    assert len(known) >= 100


def test_what_means_a_bundled_case_is_left_out(scenarios: Path) -> None:
    from training.driving import UNDISTURBED
    from training.plan import Item

    address = f"{scenarios}/scenario3/behind_the_bus.foresee::commuter"
    item = Item(address, "3", 1, UNDISTURBED)
    assert loaded(Project(), item, bundled_meanings(scenarios)) is None
    assert loaded(Project(), item, frozenset()) is not None


def test_held_out_towns_are_in_no_plan(carla: Path) -> None:
    assert {"Town02", "Town10HD"} == set(CARLA_HELD_OUT)
    assert not set(town_names(carla)) & set(CARLA_HELD_OUT)
    assert "Town01" in town_names(carla)
    assert not any(name.startswith("Town") for name in town_names(None))


def test_drives_through_a_generated_town(tmp_path: Path) -> None:
    net = generate("spider_signals", tmp_path, 104)
    files = [drive(net, f"one_{k}", tmp_path, np.random.Generator(np.random.PCG64(k))) for k in range(3)]
    bundles = [compile_test_case(load_test_case(file)) for file in files]
    assert len({bundle.scene.ego.route for bundle in bundles}) == 3
    for bundle in bundles:
        assert bundle.scene.goal_s - bundle.scene.start_s > 100
        assert bundle.signals
    again = drive(net, "again", tmp_path, np.random.Generator(np.random.PCG64(1)))
    assert again.read_text().replace("again", "one_1") == files[1].read_text()
    alone = drive(net, "alone", tmp_path, np.random.Generator(np.random.PCG64(1)), alone=True)
    assert len(compile_test_case(load_test_case(alone)).scene.actors) == 1


@pytest.mark.slow
def test_the_same_for_any_number_of_jobs(tmp_path: Path, scenarios: Path) -> None:
    pieces = plan(0.3, 5, tmp_path / "work", carla=None, scenarios=scenarios)
    assert pieces == plan(0.3, 5, tmp_path / "work", carla=None, scenarios=scenarios)
    items = [(piece[0],) for piece in pieces[-2:]]
    one = [Job(piece, tmp_path / f"one_{k}.npz", frozenset()) for k, piece in enumerate(items)]
    two = [Job(piece, tmp_path / f"two_{k}.npz", frozenset()) for k, piece in enumerate(items)]
    tallies = [record_piece(job) for job in one]
    total = record_all(two, 2)
    assert total.samples == sum(tally.samples for tally in tallies) > 0
    for a, b in zip(one, two, strict=True):
        assert a.out.read_bytes() == b.out.read_bytes()
