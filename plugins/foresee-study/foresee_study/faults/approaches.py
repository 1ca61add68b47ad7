"""The search approaches that are compared: each has a name and the settings of a campaign."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

MANY_POINTS = 1000


@dataclass(frozen=True)
class Approach:
    """A search approach.

    Attributes:
        name: its name. settings: campaign settings that differ from the default; None: the test cases are driven
            unchanged, with one seed of the sensors' noise after the other.
    """

    name: str
    settings: Mapping[str, Any] | None = field(default_factory=dict)


APPROACHES = {
    approach.name: approach
    for approach in (
        Approach("plain", None),
        Approach("random", {"ranker": "random"}),
        Approach("proximity", {"ranker": "proximity"}),
        Approach("foresee", {"ranker": "foresee"}),
        Approach("paper", {"ranker": "foresee", "preset": "paper"}),
        Approach("careful", {"ranker": "careful", "preset": "avoidable"}),
        Approach("adaptive", {"ranker": "foresee", "allocation": "adaptive"}),
        Approach("careful-adaptive", {"ranker": "careful", "preset": "avoidable", "allocation": "adaptive"}),
        Approach("exhaustive", {"ranker": "exhaustive", "risky_points": MANY_POINTS}),
    )
}
DEFAULT = ("plain", "random", "proximity", "foresee", "careful", "exhaustive")
