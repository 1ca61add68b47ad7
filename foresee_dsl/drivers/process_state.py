"""Detects changes that a driver must not make to its process, undoes them after the run, and describes them in words.

A driver runs in the same process as the simulator. If it changes the working folder, clears the environment or replaces
a function of numpy, the tool's next steps in this process would fail, and the next run would begin differently.
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
"""Modules whose functions are checked: the simulator, the forecaster and the mutator call them. Ours."""
_NAMED = 5
"""Maximum number of names that a sentence lists. Ours."""
_READ_AT_START = "LD_LIBRARY_PATH"
"""The dynamic linker reads this variable when a process begins, so a change that is undone has had no effect. `import
cv2` (opencv-python 5.0) changes it."""
_SEEDS = 2**32
"""Number of possible seeds of numpy's old global generator; larger seeds are refused by numpy."""


@dataclass(frozen=True)
class ProcessState:
    """The state of this process that a driver must not change. New variables and new functions are allowed."""

    folder: Path | None
    environment: dict[str, str]
    names: tuple[dict[str, Any], ...]
    errors: dict[str, Any]
    filters: tuple[Any, ...]
    locale: str

    @classmethod
    def now(cls) -> ProcessState:
        """Return the current state of the process."""
        return cls(
            _folder(), dict(os.environ), tuple(map(_public, _MODULES)), dict(np.geterr()), tuple(warnings.filters),
            locale.setlocale(locale.LC_NUMERIC),
        )  # fmt: skip

    def put_back(self) -> tuple[str, ...]:
        """Undo the changes since this state was taken, and return them as phrases that follow "the driver"."""
        return tuple(
            phrase
            for phrase in (
                self._put_back_names(),  # this comes first, because the next methods call these functions
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
        changed = [name for name in changed if name != _READ_AT_START]
        return f"removed or changed {_named(changed, 'environment variable')}" if changed else ""

    def _put_back_names(self) -> str:
        changed: list[str] = []
        for module, before in zip(_MODULES, self.names, strict=True):
            now = vars(module)
            different = [name for name, value in before.items() if not _same(now.get(name, _GONE), value)]
            for name in different:
                setattr(module, name, before[name])
            changed += (f"{module.__name__}.{name}" for name in different)
        return f"replaced {_named(changed, 'name')}" if changed else ""

    def _put_back_errors(self) -> str:
        now = dict(np.geterr())
        if now == self.errors:
            return ""
        np.seterr(**self.errors)
        return "changed how numpy handles floating-point errors (numpy.seterr)"

    def _put_back_filters(self) -> str:
        """Remove filters that turn warnings into errors, because code that only warns would then raise; other filters
        are harmless.
        """
        added = [entry for entry in warnings.filters if entry[0] == "error" and entry not in self.filters]
        for entry in added:
            warnings.filters.remove(entry)  # type: ignore[attr-defined]  # a list
        return "turned warnings into errors" if added else ""

    def _put_back_locale(self) -> str:
        """Restore the locale of numbers. In some locales C libraries, such as SUMO's, read and write `0,5` instead of
        `0.5`.

        SUMO 1.28 itself sets other parts of the locale, which stay.
        """
        now = locale.setlocale(locale.LC_NUMERIC)
        if now == self.locale:
            return ""
        locale.setlocale(locale.LC_NUMERIC, self.locale)
        return f"changed the locale of numbers to {now}"


def _same(now: object, before: object) -> bool:
    """Return whether a name still has its value; an equal tuple is the same, since `import pandas` has the time zone
    read again, which gives `time.tzname` a new tuple.
    """
    return now is before or (isinstance(before, tuple) and type(now) is type(before) and now == before)


_GONE = object()
_changes: list[str] = []
"""The changes that drivers have made to this process so far."""


def changes_here() -> tuple[str, ...]:
    """Return the changes that drivers have made to this process so far, as phrases that follow "the driver"."""
    return tuple(dict.fromkeys(_changes))


@contextlib.contextmanager
def put_back(seed: int) -> Iterator[list[str]]:
    """Undo a driver's changes to the process at the end of this block; yield a list that contains them after the block.

    Python's and numpy's global random generators begin with the run's seed, so that a driver that uses them drives in
    the same way whatever was run before in this process; their states are restored, too.
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
    """Seed the global random generators with a run's seed."""
    random.seed(seed)
    np.random.seed(seed % _SEEDS)


def _folder() -> Path | None:
    """Return the working folder, None if it was deleted."""
    try:
        return Path.cwd()
    except OSError:
        return None


def _public(module: ModuleType) -> dict[str, Any]:
    return {name: value for name, value in vars(module).items() if not name.startswith("_")}


def _named(names: list[str], what: str) -> str:
    """Return names as text: `3 environment variables (HOME, PATH, USER)`."""
    listed = ", ".join(names[:_NAMED]) + (", ..." if len(names) > _NAMED else "")
    return f"{len(names)} {what}{'' if len(names) == 1 else 's'} ({listed})"
