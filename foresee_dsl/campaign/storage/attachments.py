"""What tasks need beside their few words: test cases and traces, as files for processes here or as bytes for others."""

from __future__ import annotations

import io
import pickle
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path

from foresee_dsl.campaign.storage.traces import Blobs
from foresee_dsl.language.model import Network, VehicleModel
from foresee_dsl.language.project.document import TestCase
from foresee_dsl.simulate.trace import Trace


@dataclass(frozen=True)
class Ref:
    """Some bytes: where they are, or themselves for a process that may be on another machine. `name` is their hash."""

    name: str
    path: Path
    data: bytes | None = None

    def read(self) -> bytes:
        """Return the bytes.

        Raises:
            OSError: the file is gone.
        """
        return self.path.read_bytes() if self.data is None else self.data

    def inline(self) -> Ref:
        """Return it with its bytes."""
        return replace(self, data=self.read())


@dataclass(frozen=True)
class CaseRef:
    """A test case: what is its own, and the network and models that it shares with many."""

    own: Ref
    world: Ref

    def inline(self) -> CaseRef:
        """Return it with its bytes."""
        return CaseRef(self.own.inline(), self.world.inline())


_World = tuple[Network | Path, Mapping[str, VehicleModel]]


class CaseFiles:
    """Puts test cases where workers find them. What is run is what was loaded, also when its file is edited meanwhile.

    The files are pickles: they are for processes of this campaign alone, and go with its working folder.
    """

    def __init__(self, folder: Path) -> None:
        self._blobs = Blobs(folder)
        self._refs: dict[str, CaseRef] = {}
        self._worlds: dict[int, tuple[object, Ref]] = {}

    def ref(self, case: TestCase) -> CaseRef:
        """Return the reference of a test case, writing it if it is new."""
        if case.id not in self._refs:
            own = replace(case, document=None, network=Path(), models={})
            self._refs[case.id] = CaseRef(self._put(own), self._world(case))
        return self._refs[case.id]

    def _world(self, case: TestCase) -> Ref:
        # By identity first: the cases of a project share the network's object, and pickling it takes a while.
        known = self._worlds.get(id(case.network))
        if known is None or known[0] is not case.network or isinstance(case.network, Path):
            self._worlds[id(case.network)] = known = (case.network, self._put((case.network, dict(case.models))))
        return known[1]

    def _put(self, value: object) -> Ref:
        name = self._blobs.put(pickle.dumps(value))
        return Ref(name, self._blobs.path(name))


def load_case(ref: CaseRef) -> TestCase:
    """Return a test case; a process keeps those that it had lately."""
    case = _loaded(ref.own)
    network, models = _loaded_world(ref.world)
    return replace(case, network=network, models=models)


def load_trace(ref: Ref) -> Trace:
    """Return a trace of the store.

    Raises:
        OSError: its file is gone.
        ValueError: its file is no trace.
    """
    return Trace.load(io.BytesIO(ref.read()))


@lru_cache(maxsize=256)
def _loaded(ref: Ref) -> TestCase:
    case = pickle.loads(ref.read())  # noqa: S301 - of this campaign
    if not isinstance(case, TestCase):
        raise TypeError(f"{ref.path} holds no test case")
    return case


@lru_cache(maxsize=16)
def _loaded_world(ref: Ref) -> _World:
    world: _World = pickle.loads(ref.read())  # noqa: S301 - of this campaign
    return world
