"""The plug-in as the core sees it: its absence is answered with what it offers, and its kernels are compiled."""

from __future__ import annotations

from importlib.metadata import entry_points

from foresee_dsl.kernels import compiling
from foresee_dsl.plugins import BESIDE, package_of


def test_the_core_names_all_that_it_offers() -> None:
    offered: dict[str, list[str]] = {}
    for group in ("foresee_dsl.drivers", "foresee_dsl.raster_views"):
        offered[group] = sorted(e.name for e in entry_points(group=group) if package_of(e) == "foresee-learned")
    assert offered == {group: list(names) for group, names in BESIDE["learned"].items()}


def test_its_kernels_are_compiled_with_those_of_the_core() -> None:
    """Compiled by the first step that needs one, a driver would be late for its answer on a busy machine."""
    kernels = {kernel.py_func.__name__: kernel.py_func for kernel in compiling._kernels_of("foresee_learned.kernels")}
    assert set(kernels) == {"aim", "bounds", "box_pixels"}
    assert "foresee_learned.kernels" in compiling._added()
    states = {compiling._state_around(function) for function in kernels.values()}
    assert len(states) == 1 and states != {compiling._state_around(compiling._machine)}
