"""Bounds and defaults of the campaign settings that the command line and the campaign file share.

Nothing of the package is imported here: `foresee campaign --help` needs them without the model.
"""

from __future__ import annotations

from enum import StrEnum

AROUND_S = (0.5, 60)
"""Allowed seconds of a clip before and after its risky point, from the shortest to the longest."""
DEFAULT_AROUND_S = 5.0
"""Seconds of a clip before and after its risky point (the paper's best configuration: section 4.5, RQ1)."""
RISKY_POINTS = (1, 1000)
CHILDREN_BOUNDS = (0, 1000)
DEFAULT_CHILDREN = 4
"""Number of mutants per clip (the paper's c, in its best configuration: section 4.5, RQ1)."""
REPEAT = (1, 100_000)
"""Allowed numbers of repetitions. Ours: far above the needs of the study, which had 34,416 runs."""
SEED = (0, 2**31 - 1)


class RulesMode(StrEnum):
    """What a broken rule means for a run that passed otherwise: it fails, it passes with a report, or no rule is
    examined."""

    FAIL = "fail"
    REPORT = "report"
    OFF = "off"


RULES_MODE = RulesMode.FAIL
"""Default of `--rules`: a run in which the ego breaks a rule fails, because a driver that runs a red light should not
pass."""
