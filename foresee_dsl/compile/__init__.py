"""Model to SUMO: networks, signals, vehicle types and routes, through templates and netconvert; cached by content."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from foresee_dsl.compile.bundle import SumoBundle
    from foresee_dsl.language.document import TestCase

__all__ = ["compile_test_case"]


def compile_test_case(case: TestCase) -> SumoBundle:
    """Compile a test case: its network (from the cache where it is known), vehicle types, signals and scene.

    Raises:
        InputError: what it says is impossible on its network; one diagnostic for each mistake.
        CompileError: SUMO's programs are missing or refuse the network.
    """
    from foresee_dsl.compile.compiler import compile_case  # numpy, shapely, networkx: only where something is compiled

    return compile_case(case)
