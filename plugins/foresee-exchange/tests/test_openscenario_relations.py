"""Actions of OpenSCENARIO that keep an actor across its lane or by another: read, and written again."""

from __future__ import annotations

from pathlib import Path

from foresee_exchange.openscenario.reading import importer

from foresee_dsl.language.model import When
from foresee_dsl.language.printer import print_item
from foresee_dsl.language.project.loading import load_test_case
from tests.support import openscenario_files as osc
from tests.support.openscenario_files import OF_ENTITY, PRIVATE

_SPEED = (
    '<LongitudinalAction><SpeedAction><SpeedActionDynamics dynamicsShape="step" value="0" dynamicsDimension="time"/>'
    '<SpeedActionTarget><RelativeTargetSpeed entityRef="Ego" value="1.1" speedTargetValueType="factor" '
    'continuous="true"/></SpeedActionTarget></SpeedAction></LongitudinalAction>'
)
_OPPOSITE = (
    '<LateralAction><LaneChangeAction><LaneChangeActionDynamics dynamicsShape="sinusoidal" value="2" '
    'dynamicsDimension="time"/><LaneChangeTarget><AbsoluteTargetLane value="1"/></LaneChangeTarget>'
    "</LaneChangeAction></LateralAction>"
)
_CURVED = PRIVATE["LaneOffsetAction"].replace('"step"', '"cubic" maxLateralAcc="1.5"')
_ACROSS = OF_ENTITY["RelativeDistanceCondition"].replace("cartesianDistance", "lateral")


def test_they_become_actions_of_ours(tmp_path: Path) -> None:
    actions = {
        "gap": PRIVATE["LongitudinalDistanceAction"],
        "offset": _CURVED,
        "beside": PRIVATE["LateralDistanceAction"],
        "same": PRIVATE["SynchronizeAction"],
        "matched": _SPEED,
        "over": _OPPOSITE,
        "back": osc.lane_change(-1).replace('value="-1"', 'value="-2"'),
    }
    found = [
        osc.event(name, action, osc.of_entity("Ego", OF_ENTITY["SpeedCondition"])) for name, action in actions.items()
    ]
    found += [
        osc.event(name, osc.speed_action("3"), osc.of_entity("Ego", condition))
        for name, condition in (("faster", OF_ENTITY["RelativeSpeedCondition"]), ("near", _ACROSS))
    ]
    done = importer.run(
        osc.write(tmp_path / "in", osc.scenario(events=osc.group("Target-1", *found))), out=tmp_path / "out"
    )
    assert not done.lost
    whens = load_test_case(tmp_path / "out" / "cut_in.foresee").scenario.all(When)
    text = [" ".join(print_item(when).split()) for when in whens]
    gap, offset, beside, same, matched, over, back, faster, near = text
    assert "target_1 leads ego gap 9 m" in gap or "target_1 follows ego gap 9 m" in gap
    assert "target_1 changes line to 1 m over 2 s" in offset
    assert "target_1 keeps 2 m right of ego" in beside or "target_1 keeps 2 m left of ego" in beside
    assert "target_1 synchronises at (200 m, " in same and " with ego at (200 m, " in same
    assert "target_1 matches ego times 1.1" in matched
    assert "target_1 follows [" in over and "joins" not in over
    assert "target_1 follows [" in back and "then joins [" in back
    assert "when relative_speed(ego, walker) < 5 m/s" in faster
    assert "when lateral(ego, walker) < 5 m" in near
