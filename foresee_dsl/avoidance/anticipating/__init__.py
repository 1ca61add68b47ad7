"""Judges whether a driver who anticipates would have prevented a failure.

By braking, by evading, or by caution before.

"Caution before" is called driving ahead of time: the driver slows early for possible hazards.

It stands beside R157's driver (`avoidance.r157`), which brakes once the risk is 2 s away. This one acts as soon as its
sensors show that an actor will come into its way (`foresight`). It brakes comfortably where that is enough, or evades
into free space within comfortable limits; if neither helps, it drives with care from the start of the clip (`ahead`).
The manoeuvres that the kinematic screening proposes are driven in the real simulation, where the others react.
"""

from foresee_dsl.avoidance.anticipating.answer import Answer, Anticipation
from foresee_dsl.avoidance.anticipating.assessing import AnticipatingDriver

__all__ = ["Answer", "AnticipatingDriver", "Anticipation"]
