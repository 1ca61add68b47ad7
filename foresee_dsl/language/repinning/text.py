"""What `foresee repin` says about children, in words."""

from __future__ import annotations

from collections.abc import Sequence

from foresee_dsl.language.diff.parts import Difference
from foresee_dsl.language.diff.rendering import render_groups
from foresee_dsl.language.messages.diagnostics import render_all
from foresee_dsl.language.repinning.repin import Child, State


def describe(child: Child, verdict: tuple[str, str] | None = None, *, written: bool = False) -> str:
    """Return the report about one child; empty for one that is up to date.

    Args:
        child: as planned.
        verdict: what its runs ended with under the old parent ("" where that is unknown) and the new one.
        written: the new pins have been written.
    """
    if child.state is State.FRESH:
        return ""
    lines = [_head(child, written)]
    if child.mistakes:
        lines.append(_indented(render_all(child.mistakes)))
    if child.state is not State.BLOCKED and not child.follows:
        lines += _edit(child)
    if verdict is not None:
        lines.append(_verdict(*verdict))
    return "\n".join(lines) + "\n\n"


def summary(children: Sequence[Child], *, written: bool = False) -> str:
    """Return the last line: how many of each."""
    count = {state: sum(child.state is state for child in children) for state in State}
    done = "re-pinned" if written else "to re-pin (`--write` does it)"
    parts = [
        f"{count[State.FRESH]} up to date",
        f"{count[State.STALE]} {done}",
        f"{count[State.CONFLICT]} in conflict",
        f"{count[State.BLOCKED]} blocked",
    ]
    return ", ".join(part for part in parts if not part.startswith("0 ")) or "no children"


def _head(child: Child, written: bool) -> str:
    if child.state is State.CONFLICT:
        return f"{child.file}: conflict with {child.parent}, not re-pinned"
    if child.state is State.BLOCKED:
        return f"{child.file}: blocked, not re-pinned"
    why = f"follows {child.parent}" if child.follows else f"{child.parent} changed"
    return f"{child.file}: {why}\n  pin {child.pin} => {child.new_pin}{' (written)' if written else ''}"


def _edit(child: Child) -> list[str]:
    if not child.known:
        unknown = "  what changed is unknown: git has no version of the parent with this pin"
        return [unknown] if child.new_pin else []
    lines = [f"  the parent as pinned is in commit {child.commit}"]
    if child.reaching:
        lines.append(_part("reaches this child", child.reaching))
    if child.overridden:
        lines.append(_part("does not reach it: the child has its own, or has no part in it", child.overridden))
    if not child.reaching and not child.overridden:
        lines.append("  the edit changes nothing in this child")
    return lines


def _part(title: str, changes: Sequence[Difference]) -> str:
    return f"  {title}:\n{_indented(render_groups(changes).rstrip())}"


def _verdict(was: str, now: str) -> str:
    if not was:
        return f"  run: {now} (the old run is unknown)"
    return f"  run: the same, {now}" if was == now else f"  run: {was} => {now}"


def _indented(text: str) -> str:
    return "\n".join(f"    {line}" if line else "" for line in text.split("\n"))
