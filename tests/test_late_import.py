"""Modules that are imported when they are first used."""

import sys
from types import ModuleType

import pytest

from foresee_dsl.late_import import import_late


@pytest.fixture(autouse=True)
def not_imported(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delitem(sys.modules, "graphlib", raising=False)
    monkeypatch.delitem(sys.modules, "wsgiref", raising=False)
    monkeypatch.delitem(sys.modules, "wsgiref.util", raising=False)


def test_a_function_is_imported_when_it_is_called() -> None:
    import_late("wsgiref.util", functions=["guess_scheme"])
    standin = sys.modules["wsgiref.util"]
    from wsgiref.util import guess_scheme

    assert sys.modules["wsgiref.util"] is standin
    assert guess_scheme({}) == "http"
    assert sys.modules["wsgiref.util"] is not standin


def test_whatever_else_is_named_imports_the_module() -> None:
    import_late("graphlib")
    from graphlib import TopologicalSorter

    assert list(TopologicalSorter({"b": ["a"]}).static_order()) == ["a", "b"]
    import graphlib

    assert graphlib.TopologicalSorter is TopologicalSorter
    with pytest.raises(AttributeError):
        _ = graphlib.nothing  # type: ignore[attr-defined]


def test_submodules_of_a_standin_are_found() -> None:
    import_late("wsgiref")
    import wsgiref.util

    assert callable(wsgiref.util.guess_scheme)


def test_what_is_imported_stays() -> None:
    import json

    import_late("json")
    assert sys.modules["json"] is json
    import_late("no_such_module")
    assert not isinstance(sys.modules.get("no_such_module"), ModuleType)


def test_a_package_has_the_standin_as_it_would_have_the_module() -> None:
    import wsgiref

    vars(wsgiref).pop("util", None)
    import_late("wsgiref.util")
    import wsgiref.util

    assert callable(wsgiref.util.guess_scheme)
    assert wsgiref.util is sys.modules["wsgiref.util"]
