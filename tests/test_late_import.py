"""Modules that are imported when they are first used."""

import subprocess
import sys
from types import ModuleType

import pytest

from foresee_dsl.late_import import import_late, left_out


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


def test_what_is_left_out_is_as_if_never_imported() -> None:
    import wsgiref

    vars(wsgiref).pop("util", None)
    with left_out("wsgiref.util.nothing"):
        import wsgiref.util.nothing

        assert not hasattr(wsgiref.util, "guess_scheme")
    assert not hasattr(wsgiref, "util")
    assert {"wsgiref.util", "wsgiref.util.nothing"}.isdisjoint(sys.modules)
    import wsgiref.util

    assert callable(wsgiref.util.guess_scheme)
    with left_out("wsgiref.util.nothing"), left_out("no_such_package.nothing"):
        assert "guess_scheme" in vars(sys.modules["wsgiref.util"])
        assert "no_such_package" not in sys.modules


def test_kernels_leave_scipy_out_and_drivers_may_use_it_after_them() -> None:
    code = """
import sys
import foresee_dsl.drivers.pdm
assert "scipy.linalg" not in sys.modules
import numba, numpy as np, scipy.linalg, scipy.linalg.cython_blas
assert scipy.linalg.cython_blas.__pyx_capi__["dgemm"]
assert np.allclose(scipy.linalg.expm(np.zeros((2, 2))), np.eye(2))
product = numba.njit(lambda a, b: np.dot(a, b))(np.eye(2), np.ones((2, 2)))
assert (product == 1).all()
"""
    subprocess.run([sys.executable, "-c", code], check=True)
