"""Whether a driver who anticipates would have prevented a failure: by braking, by evading, or by driving ahead of time.

It stands beside R157's driver (`avoidance.r157`), which brakes once the risk is 2 s away. This one begins as
soon as its sensors tell that somebody comes into its way (`foresight`), brakes comfortably where that is enough, may
step aside into free space within comfortable limits, and else is asked to have driven with care from the start of the
clip (`ahead`). What the kinematic screening proposes is driven in the real simulation, where the others react.
"""

from foresee_dsl.avoidance.anticipating.answer import Answer, Anticipation
from foresee_dsl.avoidance.anticipating.assessing import AnticipatingDriver

__all__ = ["Answer", "AnticipatingDriver", "Anticipation"]
