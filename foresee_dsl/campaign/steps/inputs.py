"""Inputs of steps: test cases and traces, as files for processes here or as bytes for other machines."""

from __future__ import annotations

import io
import pickle
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path

from foresee_dsl.campaign.storage.traces import name_of
from foresee_dsl.language.model import Network, VehicleModel
from foresee_dsl.language.project.document import TestCase
from foresee_dsl.measuring import Part
from foresee_dsl.simulate.trace import Trace


@dataclass(frozen=True)
class InputRef:
    """Some bytes: their file, or the bytes themselves for a process on another machine. `name` is their hash."""

    name: str
    path: Path
    data: bytes | None = None

    def read(self) -> bytes:
        """Return the bytes.

        Raises:
            OSError: the file does not exist any more.
            ValueError: it was changed.
        """
        data = self._bytes()
        if name_of(data) != self.name:
            raise ValueError(f"{self.path} was changed on the disk")
        return data

    def inline(self) -> InputRef:
        """Return a reference that contains its bytes; its reader checks whether they were changed."""
        return replace(self, data=self._bytes())

    def _bytes(self) -> bytes:
        return self.path.read_bytes() if self.data is None else self.data


@dataclass(frozen=True)
class CaseRef:
    """A test case: its own part, and the network and models that it shares with others."""

    own: InputRef
    shared: InputRef

    def inline(self) -> CaseRef:
        """Return a reference that contains its bytes."""
        return CaseRef(self.own.inline(), self.shared.inline())


@Part.STORE.measured
def load_case(ref: CaseRef) -> TestCase:
    """Return a test case; a process caches the last ones."""
    network, models = _loaded_shared(ref.shared)
    return replace(_loaded(ref.own), network=network, models=models)


@Part.STORE.measured
def load_trace(ref: InputRef) -> Trace:
    """Return a trace of the store.

    Raises:
        OSError: its file is gone.
        ValueError: its file was changed, or is not a trace.
    """
    return Trace.load(io.BytesIO(ref.read()))


@lru_cache(maxsize=32)
def _loaded(ref: InputRef) -> TestCase:
    case = pickle.loads(ref.read())  # noqa: S301 - of this campaign
    if not isinstance(case, TestCase):
        raise TypeError(f"{ref.path} does not contain a test case")
    return case


@lru_cache(maxsize=16)
def _loaded_shared(ref: InputRef) -> tuple[Network | Path, Mapping[str, VehicleModel]]:
    shared: tuple[Network | Path, Mapping[str, VehicleModel]] = pickle.loads(ref.read())  # noqa: S301 - as above
    return shared
