"""Judges whether a driver who anticipates would have prevented a failure: by braking, by evading, or by earlier
caution.

The last is called driving ahead of time: the driver slows early for possible hazards. The anticipating driver
complements R157's driver (`avoidance.r157`), which brakes once the risk is 2 s away. It acts as soon as its sensors
show that an actor will come into its way (`foresight`). It brakes comfortably where that is enough, or evades into free
space within comfortable limits; if neither helps, it drives with care from the start of the clip (`ahead`). The
manoeuvres that the kinematic screening proposes are driven in the real simulation, where the others react.
"""

from foresee_dsl.avoidance.anticipating.assessing import Answer, AnticipatingDriver, Anticipation

__all__ = ["Answer", "AnticipatingDriver", "Anticipation"]
