"""Commands of other packages: functions with typer options, registered in the entry-point group `foresee_dsl.commands`.

Entry points are read only when a help or a command of another package is requested, and a package is imported only when
its command runs. So the lines of the help come from the source files.
"""

from __future__ import annotations

import ast
from collections.abc import Callable
from contextlib import suppress
from functools import wraps
from importlib.machinery import PathFinder
from importlib.metadata import EntryPoint
from importlib.util import find_spec
from types import FunctionType
from typing import Any

from foresee_dsl.errors import ForeseeError
from foresee_dsl.plugins import PluginGroup, package_of


class CommandError(ForeseeError):
    """Raised if a package offers a command that cannot be used."""


ADDED = PluginGroup("foresee_dsl.commands", "command", CommandError)


def load_command(name: str) -> Callable[..., None]:
    """Import the function of a command; a fault in it names its package.

    Raises:
        CommandError: its package is broken, or it is not a function, or several packages offer it.
    """
    call = ADDED.load(name)
    entry = ADDED.find(name)
    if not isinstance(call, FunctionType):
        raise CommandError(
            f"command {name!r} of package {package_of(entry)} is not usable: {entry.value} is not a function"
        )

    @wraps(call)
    def command(**options: Any) -> None:  # noqa: ANN401 - the function's own options
        try:
            call(**options)
        except Exception as err:
            err.add_note(f"It happened in the command {name!r} of package {package_of(entry)}.")
            raise

    return command


def help_of(name: str) -> str:
    """Return a command's docstring without importing it, or why the command cannot be used."""
    try:
        entry = ADDED.find(name)
        return _documentation(entry)
    except CommandError as err:
        return str(err)


def clashes(ours: frozenset[str]) -> tuple[str, ...]:
    """Return a sentence for each command of another package that is refused because foresee-dsl has its name."""
    return tuple(
        (
            f"the command {entry.name!r} of package {package_of(entry)} is refused, because foresee-dsl has a "
            "command of this name"
        )
        for entry in ADDED.entries()
        if entry.name in ours
    )


def _documentation(entry: EntryPoint) -> str:
    with ADDED.loading(entry):
        tree = ast.parse(_source(entry.module))
        for node in tree.body:
            if isinstance(node, ast.FunctionDef) and node.name == entry.attr:
                return ast.get_docstring(node) or ""
    return (entry.dist.metadata["Summary"] or "") if entry.dist is not None else ""


def _source(module: str) -> str:
    """Return a module's source, empty if it has none; only import finders run, not the package itself.

    Raises:
        ModuleNotFoundError: there is no such module.
    """
    top, *parts = module.split(".")
    spec, name = None, top
    with suppress(ValueError):  # this is raised for a loaded module without a spec
        spec = find_spec(top)
    for part in parts:
        name = f"{name}.{part}"
        spec = spec and PathFinder.find_spec(name, spec.submodule_search_locations or ())
    if spec is None:
        raise ModuleNotFoundError(f"No module named {name!r}")
    get_source = getattr(spec.loader, "get_source", None)
    return (get_source(name) or "") if get_source is not None else ""
