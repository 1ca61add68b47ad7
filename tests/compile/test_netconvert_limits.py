"""netconvert gets no more memory and time than a map of its size needs."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from foresee_dsl.compile.compiler import network_of
from foresee_dsl.compile.foreign.networks import foreign_net
from foresee_dsl.compile.nets.misfits import placed
from foresee_dsl.compile.nets.netconvert import NetconvertLimitError
from foresee_dsl.language.model import Network
from foresee_dsl.language.parser import parse
from foresee_dsl.limits import LimitError, most

MAP = """<?xml version="1.0"?>
<OpenDRIVE>
  <header revMajor="1" revMinor="4" name="" version="1.00"/>
  <road name="" length="{length}" id="1" junction="-1">
    <planView><geometry s="0" x="0" y="0" hdg="0" length="{length}"><arc curvature="0.001"/></geometry></planView>
    <lanes><laneSection s="0">
      <center><lane id="0" type="none" level="false"/></center>
      <right><lane id="-1" type="driving" level="false"><width sOffset="0" a="3.5" b="0" c="0" d="0"/></lane></right>
    </laneSection></lanes>
  </road>
</OpenDRIVE>
"""


MEASURED = """
import resource, sys
from pathlib import Path
from foresee_dsl.compile.foreign.networks import foreign_net
from foresee_dsl.compile.nets.netconvert import NetconvertLimitError
try:
    foreign_net(Path(sys.argv[1]))
except NetconvertLimitError:
    print(resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss)
"""


@pytest.fixture
def bomb(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A map of under 1 kB whose road of 100,000 km netconvert 1.28 resolves into points until the memory is full."""
    monkeypatch.setenv("FORESEE_CACHE", str(tmp_path / "cache"))
    file = tmp_path / "long.xodr"
    file.write_text(MAP.format(length="1e8"), encoding="utf-8")
    return file


def test_a_road_without_end_is_refused_before_it_fills_the_memory(bomb: Path) -> None:
    with pytest.raises(NetconvertLimitError, match=r"needs more than 450 MB.*--limit netconvert-memory=1800"):
        foreign_net(bomb)


def test_the_number_of_cores_does_not_count(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """SUMO's OpenBLAS takes data for each core: netconvert died on machines of four cores and more."""
    monkeypatch.setenv("FORESEE_CACHE", str(tmp_path / "cache"))
    monkeypatch.setenv("FORESEE_LIMITS", "netconvert-memory=230")
    monkeypatch.setenv("OMP_NUM_THREADS", "64")
    file = tmp_path / "short.xodr"
    file.write_text(MAP.format(length="100"), encoding="utf-8")
    assert foreign_net(file)


def test_it_takes_no_more_meanwhile(bomb: Path) -> None:
    """In a process of its own: what is forked from a large one counts as large until it becomes netconvert."""
    done = subprocess.run([sys.executable, "-c", MEASURED, bomb], capture_output=True, text=True, check=True)
    assert int(done.stdout) <= 500_000, "kB"


def test_the_time_is_a_limit_too(bomb: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("FORESEE_LIMITS", "netconvert-time=0.05")
    with pytest.raises(NetconvertLimitError, match=r"within 0.05 s; `foresee --limit netconvert-time=1 "):
        foreign_net(bomb)


TOWN = """foresee 1

network town {
  junction west_end at (0 m, 0 m)
  junction mid at (100 m, 0 m)
  road west from west_end to mid
}
"""


def test_what_netconvert_refuses_is_named_with_its_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("FORESEE_CACHE", str(tmp_path / "cache"))
    monkeypatch.setenv("FORESEE_LIMITS", "netconvert-time=0.001")
    document = parse(TOWN, "town.foresee")
    assert isinstance(document.model, Network)
    with pytest.raises(NetconvertLimitError, match=r"^'town\.foresee', line 3: network 'town': netconvert did not"):
        network_of(document.model, document)


@pytest.mark.parametrize(
    ("message", "where"),
    [
        ("no connections at node 'mid'.", "'town.foresee', line 5: junction 'mid' of network 'town'"),
        ("Edge 'west_back' has no length.", "'town.foresee', line 6: road 'west' of network 'town'"),
        ("Unknown option 'all'.", "'town.foresee', line 3: network 'town'"),
    ],
)
def test_a_message_of_netconvert_is_placed_at_what_it_names(message: str, where: str) -> None:
    document = parse(TOWN, "town.foresee")
    assert isinstance(document.model, Network)
    assert placed(message, document.model, document) == f"{where}: {message}"
    assert placed(message, document.model, None) == f"{where.partition(': ')[2]}: {message}"


def test_a_limit_that_is_none_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("FORESEE_LIMITS", "netconvert-memory=2000")
    assert most("netconvert-memory") == 2000
    monkeypatch.setenv("FORESEE_LIMITS", "netconvert=2000")
    with pytest.raises(LimitError, match="there is no limit 'netconvert'; there are netconvert-memory"):
        most("trace")
    monkeypatch.setenv("FORESEE_LIMITS", "trace=much")
    with pytest.raises(LimitError, match="write trace=400"):
        most("trace")
