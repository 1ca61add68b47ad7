"""Gives mistakes that show only once the network is known their places in the file."""

from __future__ import annotations

from foresee_dsl.errors import Diagnostic, InputError
from foresee_dsl.language import model as m
from foresee_dsl.language.project.document import Document, Problem, TestCase
from foresee_dsl.language.traversal import walk


def diagnose(case: TestCase, problems: tuple[Problem, ...]) -> InputError:
    """Turn the compiler's problems into an error that can be shown with its places.

    A problem of an actor is placed at its statement of the kind at fault, or else at the actor; in a mutant at the
    `change` line for the actor; a problem of the scenario at its statement of that kind. What is written elsewhere (in
    the clip that a mutant changes) is marked so in its message.
    """
    named: set[tuple[int, str]] = set()
    found = [_diagnostic(case, problem, named) for problem in problems]
    return InputError(tuple(sorted(found, key=lambda d: (d.span.line, d.span.column) if d.span else (0, 0))))


def _diagnostic(case: TestCase, problem: Problem, named: set[tuple[int, str]]) -> Diagnostic:
    document = case.document
    if document is None:
        return Diagnostic(code=problem.code, message=problem.message, help=problem.help, path=case.id)
    item, field = _place(document, problem)
    if item is not None and problem.about:
        item, field = _named(document, item, problem, named) or (item, field)
    message = problem.message
    if item is None and problem.actor and isinstance(document.model, m.Mutant):
        message = f"{message} (as written in '{document.model.parent}')"
    return document.diagnostic(item, field, problem.code, message, problem.help)


def _place(document: Document, problem: Problem) -> tuple[m.Item | None, str]:
    body: tuple[m.Item, ...] = document.model.body
    if isinstance(document.model, m.Mutant):
        changes = [item for item in body if isinstance(item, m.Change) and item.actor == problem.actor]
        exact = (item for item in changes if item.property == problem.item)
        return next(exact, changes[0] if changes else None), ""
    if not problem.actor:
        return next((item for item in body if getattr(item, "kind", "") == problem.item), None), ""
    for item in body:
        if isinstance(item, m.Ego | m.Actor) and item.name == problem.actor:
            return _within(item, problem.item)
        if isinstance(item, m.Traffic) and problem.actor.rpartition("_")[0] == item.name:
            return item, ""
    return None, ""


def _within(actor: m.Ego | m.Actor, kind: str) -> tuple[m.Item, str]:
    """Return an actor's statement of a kind, or its field of that name, or its first words."""
    aliases = {"route": ("route", "edge_route"), "goal": ("goal", "clip_goal")}.get(kind, (kind,))
    found = next((item for item in actor.body if item.kind in aliases), None)
    if found is not None:
        return found, ""
    if kind == "state" and actor.state is not None:
        return actor.state, ""
    return actor, kind if kind in ("model", "state") else "name"


def _named(
    document: Document, first: m.Item, problem: Problem, named: set[tuple[int, str]]
) -> tuple[m.Item, str] | None:
    """Return where the name at fault stands: at its first place that no other problem has been shown at."""
    alike = (
        [item for item in document.model.body if getattr(item, "kind", "") == problem.item]
        if not problem.actor
        else [first]
    )
    for item in (part for statement in alike for part in walk(statement)):
        for field in type(item).model_fields:
            if getattr(item, field) == problem.about and (id(item), field) not in named:
                named.add((id(item), field))
                return item, field
    return None
