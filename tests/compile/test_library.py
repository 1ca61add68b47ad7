"""The bundled library: as many cases as the paper's, all of them full of others, at every form of junction."""

from __future__ import annotations

from collections import Counter

import pytest
import shapely

from foresee_dsl.compile import compile_test_case
from foresee_dsl.compile.bundle import PlacedActor, SumoBundle
from foresee_dsl.files import data_folder
from foresee_dsl.language.document import TestCase
from foresee_dsl.language.model import Doc, End, Quantity
from foresee_dsl.language.project.loading import load_test_cases

FAMILIES = {"3": 16, "4": 46, "7": 19, "8": 19, "9": 20}
"""Cases of each scenario (paper, table of scenarios)."""


@pytest.fixture(scope="module")
def library() -> list[tuple[TestCase, SumoBundle]]:
    cases = load_test_cases([str(data_folder("scenarios"))])
    return [(case, compile_test_case(case)) for case in cases]


def moving(bundle: SumoBundle) -> list[PlacedActor]:
    return [actor for actor in bundle.scene.actors[1:] if actor.control != "static"]


def test_there_are_120_cases_in_five_families(library) -> None:
    assert Counter(case.family for case, _ in library) == FAMILIES


def test_no_two_cases_are_the_same(library) -> None:
    assert len({case.meaning for case, _ in library}) == 120


def test_every_case_has_15_to_25_others_of_several_kinds(library) -> None:
    for case, bundle in library:
        assert 15 <= len(bundle.scene.actors) - 1 <= 25, case.id
        assert len(moving(bundle)) >= 12, case.id
        assert len({actor.model.kind for actor in bundle.scene.actors[1:]}) >= 3, case.id
    kinds = {actor.model.kind for _, bundle in library for actor in bundle.scene.actors[1:]}
    assert kinds == {"car", "van", "truck", "bus", "motorcycle", "bicycle", "pedestrian", "obstacle"}


def test_all_models_but_a_few_take_part(library) -> None:
    used = {actor.model.name for _, bundle in library for actor in bundle.scene.actors}
    assert len(used) >= 40


def test_the_egos_pass_every_junction_of_the_town(library) -> None:
    town = library[0][1].network
    passed = {town.edges[edge].end for _, bundle in library for edge in bundle.scene.ego.route[:-1]}
    assert passed == {junction for junction in town.junctions if not junction.endswith("_end")}


def test_runs_may_last_as_long_as_they_should(library) -> None:
    for case, _ in library:
        end = case.scenario.first(End)
        assert end is not None and isinstance(end.after, Quantity) and 25 <= end.after.si <= 90, case.id
        assert case.scenario.first(Doc) is not None, case.id


def test_nobody_walks_through_a_building(library) -> None:
    buildings = [shapely.Polygon(outline) for outline in library[0][1].network.buildings]
    for case, bundle in library:
        for actor in bundle.scene.actors[1:]:
            if actor.path:
                way = shapely.LineString(actor.path)
                assert not any(way.intersects(b) for b in buildings), (case.id, actor.id)
