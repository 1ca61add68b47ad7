"""Imports a module when it is first used, for libraries that import at their top what few calls need."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from importlib import import_module
from importlib.util import find_spec
from types import ModuleType
from typing import Any


def import_late(name: str, functions: Iterable[str] = ()) -> None:
    """Let `import NAME` give a stand-in, which imports the module when something in it is first asked for.

    One that is already imported stays as it is. `importlib.util.LazyLoader` of Python 3.11 will not do: it imports the
    module at the second `import` statement that names it.

    Args:
        functions: of the module, which `from NAME import FUNCTION` takes; it is imported when they are called.
    """
    spec = find_spec(name) if name not in sys.modules else None
    if spec is None:
        return
    standin = ModuleType(name)
    if spec.submodule_search_locations is not None:  # a package; `from` asks for it
        standin.__path__ = spec.submodule_search_locations

    def of_the_module(attribute: str) -> Any:  # noqa: ANN401 - whatever the module has
        if attribute == "__path__":
            raise AttributeError(attribute)
        if sys.modules.get(name) is standin:
            del sys.modules[name]
        return getattr(import_module(name), attribute)

    def late(function: str) -> Any:  # noqa: ANN401 - a function of the module
        return lambda *args, **options: of_the_module(function)(*args, **options)  # noqa: PLW0108 - not now

    for function in functions:
        setattr(standin, function, late(function))
    standin.__getattr__ = of_the_module  # type: ignore[method-assign]  # as a module's own function of that name
    sys.modules[name] = standin
    above, _, last = name.rpartition(".")
    if above:  # `import PACKAGE.NAME` finds the stand-in and sets nothing; numpy.testing 2.4 asks the package for it
        setattr(import_module(above), last, standin)


@contextmanager
def left_out(name: str) -> Iterator[None]:
    """Let imports of a package's module in this block give an empty one; after the block it is as if never imported.

    For a library that only wants to know whether it is there. Without its package it is not there; one that is already
    imported stays as it is.
    """
    package, _, last = name.rpartition(".")
    if package in sys.modules or find_spec(package) is None:
        yield
        return
    standins = {package: ModuleType(package), name: ModuleType(name)}
    standins[package].__path__ = []
    above, _, within = package.rpartition(".")
    for module, attribute, standin in (
        (sys.modules.get(above), within, standins[package]),
        (standins[package], last, standins[name]),
    ):
        if module is not None:
            setattr(module, attribute, standin)
    sys.modules.update(standins)
    try:
        yield
    finally:
        for each, standin in standins.items():
            if sys.modules.get(each) is standin:
                del sys.modules[each]
        if above:
            vars(sys.modules[above]).pop(within, None)
