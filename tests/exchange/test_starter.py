"""Which networks can have a first scenario: cars drive on them, and the language can express their ids."""

from __future__ import annotations

import pytest

from foresee_dsl.compile.roads.topology import Lane, NetEdge, Topology
from foresee_dsl.exchange.outcome import ExchangeError
from foresee_dsl.exchange.starter import check_network


@pytest.mark.parametrize("name", ['a"b', "a\\b", "a\nb", "", "x" * 201])
def test_ids_that_cannot_be_said_are_refused(name: str) -> None:
    check_network(_network("-12", "a b", "ä", "E0#1"), "the net")
    with pytest.raises(ExchangeError, match="rename it there"):
        check_network(_network("-12", name), "the net")


def _network(*edges: str) -> Topology:
    lane = Lane("lane", "", 0, ((0.0, 0.0), (9.0, 0.0)), 9.0, 14.0, 3.2, frozenset({"car"}), internal=False)
    return Topology({}, {name: NetEdge(name, "a", "b", (lane,)) for name in edges}, {}, (), {}, {}, ())
