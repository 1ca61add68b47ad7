"""Model to SUMO: networks, signals, vehicle types and routes, through templates and netconvert; cached by content."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import replace
from typing import TYPE_CHECKING

from foresee_dsl.errors import Diagnostic, InputError
from foresee_dsl.measuring import Part

if TYPE_CHECKING:
    from pathlib import Path

    from foresee_dsl.compile.bundle import SumoBundle
    from foresee_dsl.language.project.document import TestCase

__all__ = ["compile_test_case", "placement_lints", "placement_mistakes"]


@Part.COMPILE.measured
def compile_test_case(case: TestCase) -> SumoBundle:
    """Compile a test case: its network (from the cache where it is known), vehicle types, signals and scene.

    Raises:
        InputError: something in it is impossible on its network; one diagnostic for each error.
        CompileError: SUMO's programs are missing or refuse the network.
    """
    from foresee_dsl.compile.compiler import compile_case

    return compile_case(case)


def placement_mistakes(cases: Iterable[TestCase]) -> tuple[Diagnostic, ...]:
    """Return what is impossible in test cases on their networks, and where maps of others are broken, each once.

    Actors are placed by the compiler's own code; nothing is written but a network that is new.
    """
    from foresee_dsl import disk_cache
    from foresee_dsl.compile.nets.netconvert import tool_version

    found = _Found()
    for case in cases:
        # placing depends on a case's meaning alone; errors are not cached, as they have places in the text
        sound = disk_cache.entry("placed", (case.meaning, tool_version()))
        if disk_cache.load(sound):
            found.add(case, ())
            continue
        from foresee_dsl.compile.compiler import check_case  # here: a fifth of a check's time

        try:
            warnings = check_case(case)
        except InputError as error:
            found.add(case, error.diagnostics)
        else:
            found.add(case, warnings)
            if not warnings:
                disk_cache.store(sound, True)
    return found.named()


class _Found:
    """What is wrong in the test cases of some files: one mistake of a place is said once, with the cases that have it,
    unless all of the file have the same."""

    def __init__(self) -> None:
        self._cases: Counter[Path] = Counter()
        self._alike: dict[tuple[Path, object, int], list[tuple[str, Diagnostic]]] = {}

    def add(self, case: TestCase, diagnostics: Iterable[Diagnostic]) -> None:
        """Take what is wrong in the next test case."""
        self._cases[case.source] += 1
        name = case.id.partition("::")[2]
        seen: Counter[object] = Counter()
        for diagnostic in diagnostics:
            seen[diagnostic.key] += 1
            same = (case.source, diagnostic.key, seen[diagnostic.key])
            self._alike.setdefault(same, []).append((name, diagnostic))

    def named(self) -> tuple[Diagnostic, ...]:
        """Return every mistake, in the order in which they were found."""
        found: dict[Diagnostic, None] = {}
        for (source, *_), alike in self._alike.items():
            (name, first), others = alike[0], len(alike) - 1
            everywhere = len(alike) == self._cases[source] and len({d.message for _, d in alike}) == 1
            if name and not everywhere:
                more = f" (and {others} more)" if others else ""
                first = replace(first, message=f"in case '{name}'{more} {first.message}")
            found[first] = None
        return tuple(found)


def placement_lints(cases: Iterable[TestCase]) -> tuple[Diagnostic, ...]:
    """Return the lints that need the network, each once, without those that comments of the file allow.

    Only cases with a condition about a place or a junction, a slippery patch or a path are looked at, and neither clips
    nor mutants.
    """
    from foresee_dsl import disk_cache
    from foresee_dsl.compile.nets.netconvert import tool_version
    from foresee_dsl.language import model as m
    from foresee_dsl.language.traversal import walk

    found: dict[Diagnostic, None] = {}
    for case in cases:
        statements = (item for item in case.scenario.body if isinstance(item, m.When | m.Expect | m.Slippery))
        on_the_ground = (isinstance(part, m.Within | m.Slippery) for item in statements for part in walk(item))
        paths = (item for actor in case.scenario.actors for item in actor.body if isinstance(item, m.AnyPath))
        if case.snapshot or not (any(on_the_ground) or any(True for _ in paths)):
            continue
        clear = disk_cache.entry("reach", (case.meaning, tool_version()))
        if disk_cache.load(clear):
            continue
        from foresee_dsl.compile.compiler import warnings_of

        warnings = warnings_of(case)
        if not warnings:
            disk_cache.store(clear, True)
        elif case.document is not None:
            from foresee_dsl.language.lints.allowances import left

            warnings = left(case.document, warnings)
        found |= dict.fromkeys(warnings)
    return tuple(found)
