"""The compiled reader gives the same runs as the one in Python, and says why where it cannot be built."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest
from foresee_native import NativeReader, building

from foresee_dsl.compile import compile_test_case
from foresee_dsl.compile.bundle import SumoBundle
from foresee_dsl.drivers.pdm import PdmDriver
from foresee_dsl.errors import SimulationError
from foresee_dsl.files import data_folder
from foresee_dsl.language.project.loading import load_test_case
from foresee_dsl.simulate.runner import run
from foresee_dsl.simulate.vehicle_reader import VARIABLE, PythonReader, description
from foresee_dsl.simulate.world import World

needs_compiler = pytest.mark.skipif(
    not any(map(shutil.which, building.COMPILERS)), reason="there is no C++ compiler on this machine"
)
CASES = ("scenario7.foresee::r01", "scenario9/into_the_roundabout.foresee::lorry_past_the_far_arm")
"""Traffic with pedestrians and signals; vehicles that arrive, and stand-ins that pass each other."""


@pytest.fixture(autouse=True)
def _new_world() -> Iterator[None]:
    World.close_shared()
    yield
    World.close_shared()


def _bundle(address: str) -> SumoBundle:
    return compile_test_case(load_test_case(f"{data_folder('scenarios') / address}"))


@needs_compiler
@pytest.mark.parametrize("address", CASES)
def test_runs_are_the_same(address: str, monkeypatch: pytest.MonkeyPatch) -> None:
    bundle = _bundle(address)
    compiled = run(bundle, PdmDriver())
    assert isinstance(World.shared(bundle)._reader, NativeReader)
    World.close_shared()
    monkeypatch.setenv(VARIABLE, "0")
    plain = run(bundle, PdmDriver())
    assert isinstance(World.shared(bundle)._reader, PythonReader)
    assert compiled.trace.digest == plain.trace.digest
    assert (compiled.verdict, compiled.reason) == (plain.verdict, plain.reason)


@needs_compiler
def test_it_reads_what_python_reads(monkeypatch: pytest.MonkeyPatch) -> None:
    bundle = _bundle(CASES[0])
    monkeypatch.setenv(VARIABLE, "0")
    world = World.shared(bundle)
    for actor in bundle.scene.actors[1:]:
        if actor.control == "sumo" and actor.route:
            world.add_vehicle(actor)
    world.step()
    on_road = world._sumo.vehicle.getIDList()
    names = on_road[1:]
    readers = NativeReader(), PythonReader(world._sumo, world._errors)
    for reader in readers:
        assert reader.read() is None  # it does not follow these vehicles yet
        reader.follow(names, on_road)
    for _ in range(40):
        compiled, plain = (reader.read() for reader in readers)
        if plain is None:
            assert compiled is None
            break
        assert list(compiled or ()) == list(plain)
        assert readers[0].numbers.tobytes() == readers[1].numbers.tobytes()
        assert [readers[0].lane(k) for k in range(len(names))] == [readers[1].lane(k) for k in range(len(names))]
        assert not any(reader.disordered(names) for reader in readers)
        world.step()
    assert len(names) > 3


def test_without_a_compiler_runs_work_and_the_reason_is_shown(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("FORESEE_CACHE", str(tmp_path))
    monkeypatch.setenv("CXX", "no-such-compiler")
    with pytest.raises(SimulationError, match="no C\\+\\+ compiler: none of no-such-compiler is installed"):
        building.library()
    assert description() == ("in Python, runs take longer: no C++ compiler: none of no-such-compiler is installed")
    assert isinstance(World.shared(_bundle(CASES[0]))._reader, PythonReader)


def test_a_compiler_that_fails_is_asked_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    compiler = tmp_path / "broken"
    compiler.write_text(f"#!/bin/sh\necho called >> {tmp_path}/calls\necho 'fatal error: no headers' >&2\nexit 1\n")
    compiler.chmod(0o700)
    monkeypatch.setenv("FORESEE_CACHE", str(tmp_path / "cache"))
    monkeypatch.setenv("CXX", str(compiler))
    for message in ("fatal error: no headers$", "to try again, delete"):
        with pytest.raises(SimulationError, match=message):
            building.library()
    assert (tmp_path / "calls").read_text() == "called\n"
