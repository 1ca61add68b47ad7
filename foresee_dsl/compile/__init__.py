"""Compiles test cases to SUMO networks, signals, vehicle types and scenes, with netconvert; cached by content."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from foresee_dsl.errors import Diagnostic, InputError
from foresee_dsl.measuring import Part

if TYPE_CHECKING:
    from pathlib import Path

    from foresee_dsl.compile.bundle import SumoBundle
    from foresee_dsl.language.document import TestCase

__all__ = ["compile_test_case", "placement_lints", "placement_mistakes", "with_placements"]


@Part.COMPILE.measured
def compile_test_case(case: TestCase) -> SumoBundle:
    """Compile a test case: its network (from the cache if it is there), vehicle types, signals and scene.

    Raises:
        InputError: a statement is impossible on the network; one diagnostic for each error.
        CompileError: SUMO's programs are missing, or they reject the network.
    """
    from foresee_dsl.compile.compiler import compile_case

    return compile_case(case)


def with_placements(diagnostics: Iterable[Diagnostic], cases: Sequence[TestCase]) -> tuple[Diagnostic, ...]:
    """Return the diagnostics of a check without networks, followed by those that show only on the networks of its test
    cases; a lint that an error on the network repeats is left out."""
    mistakes = placement_mistakes(cases)
    too_fast = {(d.path, d.span.line) for d in mistakes if d.code == "FS256" and d.span is not None}

    def is_repeated(diagnostic: Diagnostic) -> bool:
        if diagnostic.code == "FS308" and diagnostic.span is not None:  # above the model's speed, as FS256
            return (diagnostic.path, diagnostic.span.line) in too_fast
        return diagnostic.code == "FS309"  # only the network decides whether a route has a gap

    return (*(d for d in diagnostics if not is_repeated(d)), *mistakes, *placement_lints(cases))


def placement_mistakes(cases: Iterable[TestCase]) -> tuple[Diagnostic, ...]:
    """Return the errors of test cases that show only on their networks, and the faults of foreign maps; each error
    once.

    Only our own code places the actors; no files are written except networks that are not yet in the cache.
    """
    from foresee_dsl import disk_cache
    from foresee_dsl.compile.nets.netconvert import tool_version

    mistakes = _Mistakes()
    for case in cases:
        # placement depends only on a case's meaning; errors are not cached, because they refer to places in the text
        sound = disk_cache.entry("placed", (case.meaning, tool_version()))
        if disk_cache.load(sound):
            mistakes.add(case, ())
            continue
        from foresee_dsl.compile.compiler import check_case  # imported here: the import takes a fifth of a check's time

        try:
            warnings = check_case(case)
        except InputError as error:
            mistakes.add(case, error.diagnostics)
        else:
            mistakes.add(case, warnings)
            if not warnings:
                disk_cache.store(sound, True)
    return mistakes.named()


class _Mistakes:
    """Collects the errors of the test cases of some files. An error at one place is reported once, with the names of
    its cases unless all cases of the file have it."""

    def __init__(self) -> None:
        self._cases: Counter[Path] = Counter()
        self._alike: dict[tuple[Path, object, int], list[tuple[str, Diagnostic]]] = {}

    def add(self, case: TestCase, diagnostics: Iterable[Diagnostic]) -> None:
        """Add the errors of a test case."""
        self._cases[case.source] += 1
        name = case.id.partition("::")[2]
        seen: Counter[object] = Counter()
        for diagnostic in diagnostics:
            seen[diagnostic.key] += 1
            same = (case.source, diagnostic.key, seen[diagnostic.key])
            self._alike.setdefault(same, []).append((name, diagnostic))

    def named(self) -> tuple[Diagnostic, ...]:
        """Return the errors in the order in which they were added, with the names of their cases."""
        named: dict[Diagnostic, None] = {}
        for (source, *_), alike in self._alike.items():
            (name, first), others = alike[0], len(alike) - 1
            everywhere = len(alike) == self._cases[source] and len({d.message for _, d in alike}) == 1
            if name and not everywhere:
                more = f" (and {others} more)" if others else ""
                first = replace(first, message=f"in case '{name}'{more}, {first.message}")
            named[first] = None
        return tuple(named)


def placement_lints(cases: Iterable[TestCase]) -> tuple[Diagnostic, ...]:
    """Return the lints that need the network, each once, without those that comments in the file allow.

    Only cases with something at a place or a junction, a slippery patch or a path are checked; clips and mutants are
    not.
    """
    from foresee_dsl import disk_cache
    from foresee_dsl.compile.nets.netconvert import tool_version
    from foresee_dsl.language import model as m
    from foresee_dsl.language.traversal import walk

    at_a_place = (m.Within, m.Slippery, m.Ignores, m.Meets)
    of_a_way = (m.Path, m.PathAlong, m.IgnoresRule, m.MeetsState)
    listed: dict[Diagnostic, None] = {}
    for case in cases:
        statements = (item for item in case.scenario.body if isinstance(item, m.When | m.Expect | m.Slippery))
        on_the_ground = (isinstance(part, at_a_place) for item in statements for part in walk(item))
        ways = (isinstance(item, of_a_way) for actor in case.scenario.actors for item in actor.body)
        if case.snapshot or not (any(on_the_ground) or any(ways)):
            continue
        clear = disk_cache.entry("ways", (case.meaning, tool_version()))
        if disk_cache.load(clear):
            continue
        from foresee_dsl.compile.compiler import warnings_of

        warnings = warnings_of(case)
        if not warnings:
            disk_cache.store(clear, True)
        elif case.document is not None:
            from foresee_dsl.language.lints.allowances import left

            warnings = left(case.document, warnings)
        listed |= dict.fromkeys(warnings)
    return tuple(listed)
