"""Imports a module when it is first used, for libraries that import at their top what few calls need."""

from __future__ import annotations

import sys
from collections.abc import Iterable
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
