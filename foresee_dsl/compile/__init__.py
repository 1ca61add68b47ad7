"""Model to SUMO: networks, signals, vehicle types and routes, through templates and netconvert; cached by content."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

from foresee_dsl.errors import Diagnostic, InputError

if TYPE_CHECKING:
    from foresee_dsl.compile.bundle import SumoBundle
    from foresee_dsl.language.document import TestCase

__all__ = ["compile_test_case", "placement_mistakes"]


def compile_test_case(case: TestCase) -> SumoBundle:
    """Compile a test case: its network (from the cache where it is known), vehicle types, signals and scene.

    Raises:
        InputError: what it says is impossible on its network; one diagnostic for each mistake.
        CompileError: SUMO's programs are missing or refuse the network.
    """
    from foresee_dsl.compile.compiler import compile_case  # numpy, shapely, networkx: only where something is compiled

    return compile_case(case)


def placement_mistakes(cases: Iterable[TestCase]) -> tuple[Diagnostic, ...]:
    """Compile test cases and return what is impossible on their networks, each mistake once.

    Raises:
        CompileError: SUMO's programs are missing or refuse a network.
    """
    found: dict[Diagnostic, None] = {}
    for case in cases:
        try:
            compile_test_case(case)
        except InputError as error:
            found |= dict.fromkeys(error.diagnostics)
    return tuple(found)
