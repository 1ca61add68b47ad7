"""What is recorded: other cases than the bundled ones, drives through other towns, the same for any number of jobs."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from training.driving import UNDISTURBED, Disturbance
from training.plan import Item, bundled_meanings, loaded, plan
from training.record import Job, record_all, record_piece
from training.towns import CARLA_HELD_OUT, GENERATED, drive, generate, town_names

from foresee_dsl.compile import compile_test_case
from foresee_dsl.language.project.loading import Project, load_test_case
from tests.support.small_street import STREET


@pytest.fixture(scope="module")
def planned(scenarios: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[tuple[Item, ...], ...]:
    return plan(0.4, 5, tmp_path_factory.mktemp("work"), carla=None, scenarios=scenarios)


@pytest.fixture(scope="module")
def known(scenarios: Path) -> frozenset[str]:
    return bundled_meanings(scenarios)


def test_no_drawn_case_means_what_a_bundled_one_does(
    planned: tuple[tuple[Item, ...], ...], known: frozenset[str]
) -> None:
    project = Project()
    drawn = [item for piece in planned for item in piece if item.family.isdigit()]
    assert {item.family for item in drawn} == {"3", "4", "7", "8", "9"}
    meanings = {project.test_case(item.address).meaning for item in drawn}
    assert len(meanings) == len(drawn) >= 36
    assert not meanings & known
    assert len(known) >= 100


def test_a_piece_has_one_network_and_all_towns_are_driven_in(planned: tuple[tuple[Item, ...], ...]) -> None:
    kinds = [{item.family if not item.family.isdigit() else "library" for item in piece} for piece in planned]
    assert all(len(kind) == 1 for kind in kinds)
    assert set.union(*kinds) == {"library", *GENERATED}
    seeds = [item.seed for piece in planned for item in piece]
    assert len(set(seeds)) == len(seeds)


def test_what_means_a_bundled_case_is_left_out(scenarios: Path, known: frozenset[str]) -> None:
    address = f"{scenarios}/scenario3/behind_the_bus.foresee::commuter"
    item = Item(address, "3", 1, UNDISTURBED)
    assert loaded(Project(), item, known) is None
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


def test_the_same_for_any_number_of_jobs(tmp_path: Path) -> None:
    (tmp_path / "street.foresee").write_text(STREET.replace("end after 14 s anywhere", "end after 5 s anywhere"))
    address = (tmp_path / "street.foresee").as_posix()
    items = [(Item(address, "3", seed, Disturbance(True, True, 2.0)),) for seed in (1, 2)]
    one = [Job(piece, tmp_path / f"one_{k}.npz", frozenset()) for k, piece in enumerate(items)]
    two = [Job(piece, tmp_path / f"two_{k}.npz", frozenset()) for k, piece in enumerate(items)]
    tallies = [record_piece(job) for job in one]
    total = record_all(two, 2)
    assert total.samples == sum(tally.samples for tally in tallies) > 0
    for a, b in zip(one, two, strict=True):
        assert a.out.read_bytes() == b.out.read_bytes()
