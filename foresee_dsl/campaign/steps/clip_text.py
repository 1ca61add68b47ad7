"""Texts of clips and mutants in a worker, and the test case of a clip."""

from __future__ import annotations

import hashlib
from functools import lru_cache
from pathlib import Path
from typing import TypeVar

from foresee_dsl.campaign.steps.inputs import CaseRef, load_case
from foresee_dsl.language.model import Clip, Mutant
from foresee_dsl.language.parser import parse
from foresee_dsl.language.project.document import TestCase
from foresee_dsl.language.project.expand import expand_clip

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
