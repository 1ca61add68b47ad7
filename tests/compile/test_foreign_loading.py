"""Networks of others that SUMO cannot load, and those with signals that have no program."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from foresee_dsl.campaign.driving import run_test_case
from foresee_dsl.compile.foreign import networks
from foresee_dsl.compile.foreign.networks import foreign_net
from foresee_dsl.compile.nets.net_reader import read_net
from foresee_dsl.compile.nets.netconvert import run_netconvert
from foresee_dsl.errors import CompileError
from foresee_dsl.language.project.loading import load_test_case
from tests.support.worlds import read_signals

NODES = """<nodes>
  <node id="w" x="-60" y="0"/><node id="j" x="0" y="0" type="traffic_light"/><node id="e" x="80" y="0"/>
  <node id="s" x="0" y="-60"/>
</nodes>"""
EDGES = """<edges>
  <edge id="a" from="w" to="j" numLanes="1" speed="13.9"/><edge id="b" from="j" to="e" numLanes="1" speed="13.9"/>
  <edge id="c" from="s" to="j" numLanes="1" speed="13.9"/>
</edges>"""
SCENE = """foresee 1

scenario over_the_rails {
  use network "x.net.xml"
  ego: car.sedan {
    route ["a", "b"]
    start at 10 m along "a"
    start speed 8 m/s
    goal 60 m along "b"
  }
  expect never collision(ego)
  expect eventually arrived(ego)
  end after 40 s
}
"""


@pytest.fixture(scope="module")
def net(tmp_path_factory: pytest.TempPathFactory) -> str:
    """A crossing with a signal, as netconvert makes it."""
    folder = tmp_path_factory.mktemp("net")
    (folder / "x.nod.xml").write_text(NODES)
    (folder / "x.edg.xml").write_text(EDGES)
    run_netconvert(["-n", "x.nod.xml", "-e", "x.edg.xml", "-o", "x.net.xml"], folder)
    return (folder / "x.net.xml").read_text()


def test_a_net_that_sumo_cannot_load_is_refused_with_its_words(net: str, tmp_path: Path) -> None:
    twice = re.sub(r"(<request [^>]*/>)", r"\1\1", net, count=1)
    (tmp_path / "x.net.xml").write_text(twice)
    with pytest.raises(CompileError, match=r"cannot be simulated: SUMO 1.28.\d cannot load it: .*junction logic 'j'"):
        foreign_net(tmp_path / "x.net.xml")


def test_a_junction_without_a_place_is_refused_before_sumo_reads_it(net: str, tmp_path: Path) -> None:
    misplaced = re.sub(r'(<junction id="w"[^>]*) x="[^"]*"', r'\1 x="-inf"', net)
    assert misplaced != net
    (tmp_path / "x.net.xml").write_text(misplaced)
    with pytest.raises(CompileError, match="junction w has no usable place or outline"):
        foreign_net(tmp_path / "x.net.xml")


def test_a_net_is_loaded_once_for_its_content(net: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "x.net.xml").write_text(net.replace("13.9", "13.7"))
    first = foreign_net(tmp_path / "x.net.xml")

    def again(_: Path) -> None:
        raise AssertionError("it was loaded again")

    monkeypatch.setattr(networks, "check_loads", again)
    assert foreign_net(tmp_path / "x.net.xml") == first


def test_a_signal_without_a_program_is_switched_off(net: str, tmp_path: Path) -> None:
    bare = re.sub(r"<tlLogic .*?</tlLogic>", "", net, flags=re.DOTALL).replace(
        'type="traffic_light" x', 'type="rail_crossing" x'
    )
    assert 'type="rail_crossing"' in bare and ' tl="j"' in bare
    (tmp_path / "x.net.xml").write_text(bare)
    (tmp_path / "x.foresee").write_text(SCENE)
    parts = read_net(foreign_net(tmp_path / "x.net.xml"))
    assert {(m.tls, m.link) for m in parts.movements} == {(None, -1)}
    assert read_signals(tmp_path / "x.net.xml", None) == {}
    result = run_test_case(load_test_case(tmp_path / "x.foresee"), "idm", 0, deadlines=None)
    assert result.verdict.value == "pass", result.reason


def test_a_net_that_ends_sumo_by_a_signal_is_refused_with_that_signal(net: str, tmp_path: Path) -> None:
    """SUMO 1.28.0 dies of SIGSEGV where a connection's inner lane is that of another connection."""
    through = dict(re.findall(r'<connection from="([ac])" [^>]* via="([^"]*)"', net))
    wrong = net.replace(f'via="{through["a"]}"', f'via="{through["c"]}"', 1)
    assert wrong != net
    (tmp_path / "x.net.xml").write_text(wrong)
    with pytest.raises(
        CompileError, match=r"cannot be simulated: SUMO 1.28.\d crashes when it loads the network \(SIGSEGV\)$"
    ):
        foreign_net(tmp_path / "x.net.xml")
