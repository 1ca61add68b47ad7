"""What a driver may not change of the process that runs it: found after a run, put back, and said in words.

A driver runs in the same process as the simulator. When it leaves its folder, clears the environment or replaces a
function of numpy, what the tool does next in this process would break, and the next run would begin otherwise than this
one did.
"""

from __future__ import annotations

import builtins
import contextlib
import locale
import math
import os
import random
import time
import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

_MODULES: tuple[ModuleType, ...] = (builtins, math, os, random, time, np, np.random)
"""Modules whose functions the simulator, the forecaster and the mutator call. Ours."""
_NAMED = 5
"""Names that a sentence has at most. Ours."""
_SEEDS = 2**32
"""numpy's old global generator takes seeds below this."""


@dataclass(frozen=True)
class ProcessState:
    """The state of this process that a driver may not change. New variables and new functions are no change."""

    folder: Path | None
    environment: dict[str, str]
    names: tuple[dict[str, Any], ...]
    errors: dict[str, Any]
    filters: tuple[Any, ...]
    locale: str

    @classmethod
    def now(cls) -> ProcessState:
        """Return the state as it is."""
        return cls(
            _folder(), dict(os.environ), tuple(map(_public, _MODULES)), dict(np.geterr()), tuple(warnings.filters),
            locale.setlocale(locale.LC_NUMERIC),
        )  # fmt: skip

    def put_back(self) -> tuple[str, ...]:
        """Put back what was changed since, and return it as phrases that follow "the driver"."""
        return tuple(
            phrase
            for phrase in (
                self._put_back_names(),  # first: what follows calls these functions
                self._put_back_folder(),
                self._put_back_environment(),
                self._put_back_errors(),
                self._put_back_filters(),
                self._put_back_locale(),
            )
            if phrase
        )

    def _put_back_folder(self) -> str:
        now = _folder()
        if now == self.folder or self.folder is None:
            return ""
        try:
            os.chdir(self.folder)
        except OSError:
            return f"deleted the working folder {self.folder}"
        return f"changed the working folder to {now or 'one that is deleted'}"

    def _put_back_environment(self) -> str:
        changed = [name for name, value in self.environment.items() if os.environ.get(name) != value]
        os.environ.update({name: self.environment[name] for name in changed})
        return f"removed or changed {_named(changed, 'environment variable')}" if changed else ""

    def _put_back_names(self) -> str:
        changed: list[str] = []
        for module, before in zip(_MODULES, self.names, strict=True):
            now = vars(module)
            different = [name for name, value in before.items() if now.get(name, _GONE) is not value]
            for name in different:
                setattr(module, name, before[name])
            changed += (f"{module.__name__}.{name}" for name in different)
        return f"replaced {_named(changed, 'name')}" if changed else ""

    def _put_back_errors(self) -> str:
        now = dict(np.geterr())
        if now == self.errors:
            return ""
        np.seterr(**self.errors)
        return "changed what numpy does about floating-point errors (numpy.seterr)"

    def _put_back_filters(self) -> str:
        """A filter that turns warnings into errors breaks code that only warns; others are no harm."""
        added = [one for one in warnings.filters if one[0] == "error" and one not in self.filters]
        for one in added:
            warnings.filters.remove(one)  # type: ignore[attr-defined]  # a list
        return "turned warnings into errors" if added else ""

    def _put_back_locale(self) -> str:
        """Libraries in C, SUMO too, read and write `0,5` in some locales. SUMO itself sets the locale's other parts."""
        now = locale.setlocale(locale.LC_NUMERIC)
        if now == self.locale:
            return ""
        locale.setlocale(locale.LC_NUMERIC, self.locale)
        return f"changed the locale of numbers to {now}"


_GONE = object()
_changes: list[str] = []
"""What drivers have changed in this process."""


def changes_here() -> tuple[str, ...]:
    """Return what drivers have changed in this process so far, as phrases that follow "the driver"."""
    return tuple(dict.fromkeys(_changes))


@contextlib.contextmanager
def put_back(seed: int) -> Iterator[list[str]]:
    """Give a driver a process that it may spoil: yield a list that holds, at the end, what it changed.

    Python's and numpy's global random generators begin with the run's seed, so that a driver which draws from them
    drives the same whatever ran before in this process; their states, too, are put back.
    """
    before = ProcessState.now()
    python, numpy = random.getstate(), np.random.get_state()
    seed_globals(seed)
    changed: list[str] = []
    try:
        yield changed
    finally:
        changed[:0] = before.put_back()
        _changes.extend(changed)
        random.setstate(python)
        np.random.set_state(numpy)


def seed_globals(seed: int) -> None:
    """Let the global random generators begin with a run's seed."""
    random.seed(seed)
    np.random.seed(seed % _SEEDS)


def _folder() -> Path | None:
    """Return the working folder, None where it is deleted."""
    try:
        return Path.cwd()
    except OSError:
        return None


def _public(module: ModuleType) -> dict[str, Any]:
    return {name: value for name, value in vars(module).items() if not name.startswith("_")}


def _named(names: list[str], what: str) -> str:
    """Return `3 environment variables (HOME, PATH, USER)`."""
    shown = ", ".join(names[:_NAMED]) + (", ..." if len(names) > _NAMED else "")
    return f"{len(names)} {what}{'' if len(names) == 1 else 's'} ({shown})"
