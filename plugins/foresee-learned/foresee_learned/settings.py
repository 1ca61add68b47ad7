"""The constants of the learned drivers' controllers, each with its source.

TransFuser: Chitta et al. 2023, "TransFuser: Imitation with Transformer-Based Sensor Fusion for Autonomous Driving", and
its published configuration. InterFuser: Shao et al. 2022, "Safety-Enhanced Autonomous Driving Using Interpretable
Sensor Fusion Transformer", its appendix on the safety controller, and its published code.
"""

from __future__ import annotations

DECIDES_S = 0.075
"""Minimum time between the measurements of the object lists of two decisions, s. Ours: it gives ten decisions a second,
with the standard sensors (a list every 0.1 s) and with ideal ones (every 0.05 s)."""

# --- waypoints to pedals ----------------------------------------------------------------------------------------
AIM_S = 0.45
AIM_LEAST_M = 2.2
"""The ego steers for the point that it reaches after `AIM_S`, s, at its current speed, but for one that is at least
`AIM_LEAST_M` ahead of its centre. Ours: with 0.6 s and 3 m, or with more, the ego cut the exit of a roundabout over its
kerb. TransFuser aims at 4 m below 5.5 m/s and at 6.5 m above."""
WAY_LEAST_M = 0.7
"""Length of the waypoints' path below which the wheels keep their angle, m. Ours: so short a path belongs to a car that
is to stand, and its direction is random."""
FRICTION_SHARE = 0.7
"""Share of the tyres' grip that steering may use. Ours: the rest is for braking in the bend."""
INTEGRAL_GAIN = 0.1
DAMPING_GAIN = 0.0
"""Gains of the PID controller of the speed, whose output is an acceleration. Ours: the proportional gain is one over
the time in which the speed is to be reached (1/s); integral 1/s, damping without unit. The gains of TransFuser have the
ratios 5 : 0.5 : 1, and its controller's output is the position of the pedals."""
INTEGRAL_STEPS = 20
"""Number of steps of the integral: it is the mean error of the last second; TransFuser's is that of the last two
seconds. Nothing older than the hand-over has an effect."""
HARD_MPS2 = 4.0
"""Required braking above which it is an emergency, and the car brakes as hard as it can, m/s^2. Ours: the target speed
applies at the end of the next second, and the expert comes to rest before that. Its everyday braking is 2 to 3 m/s^2.
TransFuser brakes fully whenever it is 10 % too fast."""
FUSION_HARD_MPS2 = 1.5
"""As `HARD_MPS2`, for `fusion`, m/s^2. Ours: its target speed is a mean over possible speeds, so it falls too slowly:
in 33 cases, with 4 m/s^2 the driver hit 4 people at 2 to 6 m/s, and with 1.5 m/s^2 none of them. TransFuser's 10 % are
1 m/s at 36 km/h."""
TARGET_STANDS_MPS = 0.3
"""Target speed below which the car is supposed to stand, m/s. Ours."""
ACCELERATION_MPS2 = 2.5
"""Largest required acceleration, m/s^2. Ours: nuPlan calls up to 2.4 m/s^2 comfortable."""

# --- safety controller ------------------------------------------------------------------------------------------
LEAST_OCCUPIED = 0.4
"""A square of the density map holds an object if the square's probability is at least this, and higher than that of its
neighbours. The value is InterFuser's."""
SURE = 0.6
OBJECT_KEPT_S = 0.45
"""Probability from which an object is remembered, and time for which a remembered object is kept while it is not seen,
s. Ours: four decisions. A child at 6 m had 99 %, 75 %, 44 %, 96 %, 40 % in turns, and the brake was released each time
it was gone. InterFuser's tracker keeps objects for five steps."""
SAME_OBJECT_M = 2.0
"""Distance to the place of an earlier object within which an object counts as the same, m: InterFuser's."""
LEAST_M = 0.5
"""Least length and width of an object, m. Ours: the network answers 0 for some people."""
MOST_OBJECTS = 30
"""Largest number of objects ahead that are considered, the nearest ones. Ours: each costs time; in the densest traffic
25 are seen."""
DECISION_S = 0.5
"""Step of the linear programme, s: InterFuser's."""
STEPS = 6
"""Number of steps of the linear programme. Ours: 3 s, the time span of the waypoints. InterFuser's 1 s is enough for
its 5 m/s; with 4 m/s^2, braking from 12 m/s takes 3 s."""
BRAKING_MPS2 = 4.0
"""Braking that the linear programme assumes, m/s^2. Ours: half of what cars do on a dry road."""
PREDICTED_S = (0.0, 0.5, 0.75, 1.0, 1.5, 2.0)
"""Times for which the places of the others are predicted, with their speed along their heading, s. The values are
InterFuser's."""
SOON_S = 1.0
"""Time within which every object in the way limits the speed, s: InterFuser's two steps. At later times, only objects
that were in the way within this time limit the speed; they are moved on by their own speed. Ours: otherwise crossing
cars that brake for their own red light would limit the ego's speed."""
SLOW_MPS = 3.0
SLOW_SOON_S = 2.0
"""The same time for slow objects, s. Ours: people who walk or run keep walking, so they limit the speed two seconds
ahead."""
SMALL_M = 2.5
SMALL_MARGIN_M = 0.4
"""Small objects are enlarged by this on each side, m: people and bicycles by a step. InterFuser doubles objects shorter
than 1.5 m."""
SPEED_ERROR_MPS = 0.5
"""Speed below which others count as standing, m/s. Ours: the error of the network's speeds."""
CREEPS_AFTER_S = 8.0
CREEPS_FOR_S = 2.0
CREEPS_MPS = 3.0
"""After the ego has stood for `CREEPS_AFTER_S`, s, without a stop line that applies and with a free way, it drives
along the route for `CREEPS_FOR_S`, s, at the speed `CREEPS_MPS`. Ours: in the training data, standing vehicles mostly
went on standing. TransFuser creeps at 4 m/s for 1.5 s after 55 s, longer than a red light takes; this driver knows
whether a light applies."""
MARGIN_M = 2.0
"""Clearance in front of an object, m: InterFuser's."""
SIDE_MARGIN_M = 0.2
"""Lateral clearance of the ego on both sides, m. Ours; InterFuser has 0.2 m more than half a car's width, and tolerates
an overlap of 4 %."""
CLOSE_SIDE_M = 0.1
CLOSE_SMALL_MARGIN_M = 0.1
"""Lateral clearance of the ego, and enlargement of small objects, beside standing objects at `CREEPS_MPS` or less, m.
Ours: with the clearances of higher speeds, a barrier 0.5 m beside the ego's way counted as being in it, and the ego
stood there for good; with these it passes at walking pace."""
BESIDE_M = 0.4
"""Apparent overlap with an object beside the ego that is tolerated, m. Ours: the error of sizes and places in the
density map. Without it the ego once stood for good beside a barrier."""
SAMPLE_M = 0.5
"""Spacing of the examined places of the ego along the waypoints, m. Ours; InterFuser has 0.2 m."""
STOP_PROBABILITY = 0.5
"""Probability from which a stop line applies while its signal is red or amber. Ours; InterFuser has 0.3, for near
junctions."""
STOP_MARGIN_M = 0.5
"""Distance between the stopped front and a stop line, m. Ours."""
PLANNED_S = 0.9
"""The waypoints' speed is read between 0.6 s and 1.2 s ahead, so that a single bad waypoint has little effect; the
speed is to be reached in the middle of that time. Ours."""
PLANNED_BETWEEN = (1, 3)
"""These times as indices of waypoints, which are 0.3 s apart."""
MOST_MPS = 25.0
"""Highest speed on a way without a known limit, m/s. Ours: 90 km/h, the highest target speed of `fusion`."""
STOP_PASSED_M = 3.0
"""Distance behind the front up to which a stop line still applies, m; farther behind, the next one applies. Ours."""
