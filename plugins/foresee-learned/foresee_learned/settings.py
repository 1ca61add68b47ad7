"""The constants of the learned drivers' controllers, each with its source.

TransFuser: Chitta et al. 2023, "TransFuser: Imitation with Transformer-Based Sensor Fusion for Autonomous Driving", and
its published configuration. InterFuser: Shao et al. 2022, "Safety-Enhanced Autonomous Driving Using Interpretable
Sensor Fusion Transformer", its appendix on the safety controller, and its published code.
"""

from __future__ import annotations

DECIDES_S = 0.075
"""A new decision is made on an object list that was measured at least this long after that of the last decision: ten a
second, with the standard sensors (a list every 0.1 s) as with ideal ones (every 0.05 s). Ours."""

# --- waypoints to pedals ----------------------------------------------------------------------------------------
AIM_S = 0.45
AIM_LEAST_M = 2.2
"""Ours: the ego steers for a point this far ahead of its centre. With 0.6 s and 3 m, as with more, the ego cut the exit
of a roundabout over its kerb. TransFuser aims at 4 m below 5.5 m/s and at 6.5 m above."""
WAY_LEAST_M = 0.7
"""Ours: shorter waypoints belong to a car that is to stand; their direction says nothing, the wheels stay as they
are."""
FRICTION_SHARE = 0.7
"""Ours: of the tyres' grip, what steering may use; the rest is for braking in the bend."""
INTEGRAL_GAIN = 0.1
DAMPING_GAIN = 0.0
"""Ours: PID of the speed, its answer an acceleration: the proportional gain is one over the time in which the speed is
to be reached (1/s); integral 1/s, damping without unit. TransFuser's has the ratios 5, 0.5, 1 and answers with
pedals."""
INTEGRAL_STEPS = 20
"""The integral is the mean error of the last second, as TransFuser's is that of two: nothing that is older than the
hand-over matters."""
HARD_MPS2 = 4.0
"""Ours: where more braking than this is asked for, it is an emergency, and the car brakes as hard as it can: the
expert comes to rest before the second is over by which the target speed is read. Its everyday braking is 2 to 3 m/s^2.
TransFuser brakes fully whenever it is 10 % too fast."""
FUSION_HARD_MPS2 = 1.5
"""Ours: the same for `fusion`, whose target speed is a mean over what may be, so that it falls too slowly: with 4 m/s^2
it hit 4 people at 2 to 6 m/s in 33 cases whom it does not hit with this. TransFuser's 10 % are 1 m/s at 36 km/h."""
TARGET_STANDS_MPS = 0.3
"""Ours: a target speed under this means to stand."""
ACCELERATION_MPS2 = 2.5
"""Ours: largest acceleration that is asked for; nuPlan calls up to 2.4 m/s^2 comfortable."""

# --- safety controller ------------------------------------------------------------------------------------------
LEAST_OCCUPIED = 0.4
"""InterFuser: the probability from which a square of the density map that is more probable than its neighbours is an
object."""
SURE = 0.6
OBJECT_KEPT_S = 0.45
"""Ours: an object that was so probable is remembered for four decisions, where it is not seen any more. A child at 6 m
had 99 %, 75 %, 44 %, 96 %, 40 % in turns, and each time that it was gone the brake was released. InterFuser's tracker
keeps them for five steps."""
SAME_OBJECT_M = 2.0
"""InterFuser: an object within this of where another was is the same."""
LEAST_M = 0.5
"""Ours: the least length and width of an object; the network says 0 for some people."""
MOST_OBJECTS = 30
"""Ours: at most this many objects ahead, the nearest, are considered, as each costs time; in the densest traffic 25 are
seen."""
STEP_S = 0.5
"""InterFuser's step of the linear programme."""
STEPS = 6
"""Ours: 3 s ahead, as far as the waypoints reach. InterFuser's 1 s is enough for its 5 m/s: with 4 m/s^2, 12 m/s are
braked away in 3 s."""
BRAKING_MPS2 = 4.0
"""Ours: the braking that the programme counts on, half of what cars do on a dry road."""
PREDICTED_S = (0.0, 0.5, 0.75, 1.0, 1.5, 2.0)
"""InterFuser's times for which the others are placed, by their speed along their heading."""
SOON_S = 1.0
"""Within InterFuser's two steps any object in the way binds; later ones only those that were in the way by then, moved
on. Ours: crossing cars that brake for their own red light would bind otherwise."""
SLOW_MPS = 3.0
SLOW_SOON_S = 2.0
"""Ours: people who walk or run keep on walking, so they bind two seconds ahead."""
SMALL_M = 2.5
SMALL_MARGIN_M = 0.4
"""Small objects are drawn larger, as InterFuser doubles what is shorter than 1.5 m: people and bicycles by a step on
each side."""
SPEED_ERROR_MPS = 0.5
"""Ours: others slower than this count as standing; the network's speeds are that far off."""
CREEPS_AFTER_S = 8.0
CREEPS_FOR_S = 2.0
CREEPS_MPS = 3.0
"""Ours: who has stood for so long, without a stop line that binds and with a free way, goes on along the route for a
moment: what stood in the training mostly went on standing. TransFuser creeps at 4 m/s for 1.5 s after 55 s, longer than
a red light takes; this driver knows whether a light binds."""
MARGIN_M = 2.0
"""InterFuser: what is left in front of an object."""
SIDE_MARGIN_M = 0.2
"""Ours: air on either side of the ego; InterFuser has 0.2 m more than half a car's width, and tolerates an overlap of
4 %."""
CLOSE_SIDE_M = 0.1
CLOSE_SMALL_MARGIN_M = 0.1
"""Ours: the same two beside what stands, at no more than `CREEPS_MPS`. A barrier 0.5 m beside the ego's way touched it
with the margins of other speeds, and it stood there for good; with these it passes at walking pace."""
BESIDE_M = 0.4
"""Ours: an object beside the ego may seem to overlap it by this much, as sizes and places in the density map are that
far off. Without it the ego once stood for good beside a barrier."""
SAMPLE_M = 0.5
"""Ours: spacing of the ego's places along the waypoints that are looked at; InterFuser has 0.2 m."""
STOP_PROBABILITY = 0.5
"""Ours: the probability from which a stop line binds while its signal is red or amber; InterFuser has 0.3, for
junctions that are near."""
STOP_MARGIN_M = 0.5
"""Ours: where the front comes to rest before a stop line."""
PLANNED_S = 0.9
"""Ours: the waypoints' speed is read between 0.6 s and 1.2 s ahead, so that a single bad waypoint does not matter; the
speed is to be reached in the middle of that time."""
PLANNED_BETWEEN = (1, 3)
"""The same as places among the waypoints, 0.3 s apart."""
MOST_MPS = 25.0
"""Ours: 90 km/h, the fastest that `fusion` can wish for; where no limit is known on the way."""
STOP_PASSED_M = 3.0
"""Ours: a stop line this far behind the front still binds; farther behind, the next one is meant."""
