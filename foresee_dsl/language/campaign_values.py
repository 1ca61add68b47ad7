"""Bounds, kinds and defaults of settings that an option and a statement share.

Nothing of the package is imported here: `foresee campaign --help` needs them without the model.
"""

from __future__ import annotations

from enum import StrEnum

AROUND_S = (0.5, 60)
"""Seconds of a clip before and after its risky point."""
RISKY_POINTS = (1, 1000)
CHILDREN = (0, 1000)
REPEAT = (1, 100_000)
"""Ours: beyond the study's size (34,416 runs) by far."""
SEED = (0, 2**31 - 1)


class RulesMode(StrEnum):
    """What a broken rule means for a run that passed otherwise: it fails, it passes with a report, or no rule is
    examined."""

    FAIL = "fail"
    REPORT = "report"
    OFF = "off"


RULES_MODE = RulesMode.FAIL
"""The default: a driver that runs a red light does not pass."""
