"""Inputs of steps: test cases and traces as files or bytes, and the models of clips and mutants that a worker reads
from their texts."""

from __future__ import annotations

import hashlib
import io
import pickle
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import TypeVar

from foresee_dsl.campaign.storage.traces import name_of
from foresee_dsl.language.document import TestCase
from foresee_dsl.language.model import Clip, Mutant, Network, VehicleModel
from foresee_dsl.language.parser import parse
from foresee_dsl.language.project.expand import expand_clip
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


_T = TypeVar("_T", Clip, Mutant)


@lru_cache(maxsize=16)
def clip_case(text: str, parent: CaseRef, file: Path) -> TestCase:
    """Return the test case of a clip's text; a process caches the last ones, as many mutants share them."""
    return expand_clip(clip_of(text), load_case(parent), source=file)


def risk_hash(clip: Clip) -> str:
    """Return a hash of a clip's `risk` line, which determines its mutation and minimisation."""
    risk = clip.risk.model_dump_json() if clip.risk is not None else ""
    return hashlib.sha256(risk.encode()).hexdigest()[:12]


@lru_cache(maxsize=16)
def clip_of(text: str) -> Clip:
    """Return the model of a clip's text; a process caches the last ones (30 ms each: a fifth of a mutant's run)."""
    return _printed(text, Clip)


def mutant_of(text: str) -> Mutant:
    """Return the model of a mutant's text."""
    return _printed(text, Mutant)


def _printed(text: str, kind: type[_T]) -> _T:
    model = parse(text, f"a {kind.__name__.lower()} of this campaign").model
    if not isinstance(model, kind):
        raise TypeError(f"{model.name} was printed as a {kind.__name__.lower()}, but was read back as a {model.kind}")
    return model
