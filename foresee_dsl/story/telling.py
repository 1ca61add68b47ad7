"""Tell a run's story: from the trace, and from the test case where the trace does not say it."""

from __future__ import annotations

from foresee_dsl.kernels.boxes import Mover
from foresee_dsl.language.project.document import TestCase
from foresee_dsl.simulate.results.outcome import STUCK_SPEED_MPS, impact
from foresee_dsl.simulate.results.verdict import Impact, Verdict
from foresee_dsl.simulate.trace import HEADING, SPEED, Trace, X, Y
from foresee_dsl.story.story import ContactClass, Moment, Story


def tell(trace: Trace, case: TestCase) -> Story:
    """Tell what happened in a run of a test case."""
    touched = _impact(trace)
    contact = _contact(trace, case, touched)
    kind = trace.actors[trace.index(touched.with_)].kind if touched else ""
    mps = float(trace.states[0, 0, SPEED])
    moments = [Moment(0.0, "ego", "starts", f"the ego drives {mps * 3.6:.0f} km/h" if mps > 0.1 else "the ego stands")]
    sentence = str(trace.meta.get("reason", ""))
    if touched:
        text = f"contact, {touched.side}, {touched.relative_mps:.1f} m/s: {touched.struck}"
        moments.append(Moment(trace.duration_s, "ego", "contact", text))
        sentence = f"{touched.struck} at {touched.relative_mps:.1f} m/s, on the ego's {touched.side}"
    return Story(
        moments=tuple(moments),
        sentence=sentence,
        opponent=touched.with_ if touched else "",
        opponent_kind=kind,
        contact=contact,
        ego_manoeuvre="stands" if contact is ContactClass.HIT_WHILE_STANDING else "drives",
        opponent_manoeuvre="",
        place="",
        touch=touched.side if touched else "",
    )


def _impact(trace: Trace) -> Impact | None:
    """Return the contact that a run ended with, as its judge saw it; None where it ended otherwise."""
    hit = next((e for e in reversed(trace.events) if e.what == "collision"), None)
    if hit is None:
        return None
    name = str(hit.detail["with"])
    return impact(_mover(trace, 0), _mover(trace, trace.index(name)), name)


def _mover(trace: Trace, actor: int) -> Mover:
    row, info = trace.states[-1, actor], trace.actors[actor]
    x, y, heading, speed = (float(row[k]) for k in (X, Y, HEADING, SPEED))
    return Mover(x, y, heading, speed, info.length_m, info.width_m)


def _contact(trace: Trace, case: TestCase, touched: Impact | None) -> ContactClass:
    if touched is None:
        off = trace.meta.get("verdict") == Verdict.F1
        return ContactClass.OFF_ROAD if off else ContactClass.NONE
    changed = {c.actor for c in case.mutant.changes if c.property in ("steer", "line")} if case.mutant else set()
    if touched.with_ in changed and touched.struck_by != "ego":
        return ContactClass.STRUCK_BY_STEERED
    if touched.ego_mps < STUCK_SPEED_MPS:
        return ContactClass.HIT_WHILE_STANDING
    return ContactClass.EGO_DROVE_INTO if touched.struck_by == "ego" else ContactClass.BOTH_MOVING
