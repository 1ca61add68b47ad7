"""The constants of the anticipating driver, each with its source.

IEEE 2846-2022 lists which properties of other road users a safety model has to bound (speed, acceleration, braking,
heading, lateral motion) and leaves the values to its user; the values here are therefore from other sources, or ours.
"""

from __future__ import annotations

import math

FIRM_MPS2 = 5.0
"""Firm braking, which is tried second, m/s^2: R157 calls harder braking an emergency manoeuvre."""
BUILDS_UP_S = 0.6
"""Time in which braking of any strength builds up, s: R157, Annex 4, appendix 3 (0.774 g after 0.6 s)."""
EASES_MPS2 = 2.0
"""Braking of an anticipating driver for hazards, m/s^2. Ours: the braking of the Intelligent Driver Model for towns
is 1.5 to 2 m/s^2 (Treiber and Kesting, Traffic Flow Dynamics, table 11.2). It is that of lifting the foot from the
accelerator and touching the brake lightly.
"""
SETS_OFF_MPS2 = 1.5
"""Acceleration after a hazard, m/s^2. Ours: that of the Intelligent Driver Model for towns."""

EXPECTED_REACTION_S = 0.75
"""Reaction time of a driver who expects a hazard, foot over the brake, s: Green, How Long Does It Take to Stop?
(Transportation Human Factors, 2000), 0.70 to 0.75 s; the same as R157's delay, without its evaluation time."""

LATERAL_MPS2 = 3.0
"""Largest lateral acceleration of evading, m/s^2: the limit of UN R79 for steering assistance in cars (category B1); we
could not look up its text.
"""
LATERAL_JERK_MPS3 = 5.0
"""Largest lateral jerk of evading, m/s^3: also R79, which limits the mean over half a second; here every moment is
limited."""
SIDESTEPS_M = (0.4, 0.8, 1.2, 1.6, 2.0, 2.5, 3.0, 3.5)
"""Lateral distances of evading that are tried on either side, m. Ours: from a swerve within the lane to a lane's
width."""

FORESEES_S = 1.45
"""Others are predicted for the time of comfortable braking and this much longer, s: R157's evaluation (0.4 s) and
delay (0.75 s), and half of the build-up."""
GAP_ACCEPTED_S = 4.1
"""Shortest time for which others are predicted, s: Highway Capacity Manual, base critical headway of left turns from a
major street. Measured: without this limit, a driver that had stopped for the first of two oncoming cars set off in
front of the second one.
"""
WALKER_HASTENS_MPS = 0.5
"""Largest change of a walker's speed that is predicted, m/s. Ours: about two thirds of the difference between running
and walking (`RUNNING_MPS`, `WALKING_MPS`).
"""
CROSSES_RAD = math.radians(45)
"""A vehicle whose heading differs from the ego's by more than this, rad, is crossing or oncoming, and is expected to
wait if it can do so by comfortable braking. Ours: 45 degrees, as `MERGES_RAD` of R157's model.
"""
GAP_S = 0.5
"""Two road users are in conflict if less time than this lies between them at one place, s. Ours: post-encroachment
times under 1 s are serious in conflict studies; the predicted boxes add the ego's length.
"""
FORGETS_S = 1.0
"""If a conflict is interrupted for less than this, it counts as one conflict, s. Ours: as long as sensors keep a track.
"""

WALKING_MPS = 1.39
"""Speed of a person who walks, m/s: 5 km/h, that of the walking adult and the obstructed child in Euro NCAP's AEB VRU
protocol.
"""
RUNNING_MPS = 2.22
"""Speed of a person who runs, here one who gets off or catches a bus, m/s: 8 km/h, that of the running adult in Euro
NCAP's AEB VRU protocol.
"""
BESIDE_M = 3.0
"""A stopped vehicle that is nearer than this to the ego's side may hide a walker, m. Ours: a lane's width."""
HIDES_M = 1.2
"""A standing object that is narrower than this does not hide a walker, m. Ours: a skip and a parked car hide a walker,
a cone and a cabinet do not.
"""
KERB_M = 2.0
"""A standing walker who is nearer than this to the ego's side may step out, m. Ours: the width of a kerb, and a step.
"""
CLOSE_M = 1.0
"""A walker who is nearer than this to the ego's side is a hazard, whatever its direction, m. Ours, measured: when
walkers were instead predicted to turn by 15 degrees at any time, the driver stopped 19 m before a walker along the
kerb.
"""
AT_CROSSING_M = 3.0
"""A walker who is nearer than this to a crossing with priority for walkers may want to cross, m. Ours: two steps.
German law (StVO 26) requires vehicles to approach such a crossing at moderate speed and to wait.
"""
NEAR_VEHICLE_M = 5.0
"""Walkers who are nearer than this to a stopped vehicle belong to it, m. Ours: a car's length."""
SLOWED_TO_MPS = 30 / 3.6
"""Lowest speed to which the driver slows for hazards, m/s. Ours, after the zones of 30 km/h in which such streets
lie."""
SLOWEST_AT_BUS_MPS = 20 / 3.6
"""Lowest speed to which the driver slows past a bus at its stop, or past a stopped vehicle with people near it, m/s.
Ours: German law (StVO 20) requires a speed at which one can stop for a person who steps out, and walking pace past a
bus with its hazard lights on.
"""
HEADWAY_S = 2.0
"""Headway behind another vehicle, s: the two-second rule of The Highway Code (UK), rule 126."""
HARDEST_MPS2 = 7.0
"""Braking that the driver assumes when it chooses its speed past hidden places, m/s^2. Ours: R157's 0.774 g less a
tenth, for the build-up."""

TURNING_RAD = math.radians(20)
"""If the ego turns by more than this within the predicted time, rad, the driver also considers others that are beside
it or come from behind. Ours: 20 degrees, as `CROSSING_RAD` of the near misses.
"""

NEARLY_STANDS_MPS = 0.3
"""Speed below which an actor counts as standing, m/s. Ours: SUMO's threshold plus a tenth of walking pace."""

MARGIN_M = 0.3
"""Smallest distance to all actors that the screening requires of braking, m. Ours: the lateral error of a fast car in a
step."""
MARGIN_ASIDE_M = 0.5
"""Smallest distance to all actors that the screening requires of evading, m. Ours."""
CLEAR_M = 0.1
"""If the ego comes nearer than this to an actor in a confirming run, the run does not show that the failure is
prevented, because chance decides, m. Ours.
"""
LOOKS_ON_S = 3.0
"""Duration of a confirming run after the failure's contact, s. Ours: at the end of this time, an ego that brakes
comfortably from 50 km/h has stood for a while, and the other actor has passed.
"""
PASSES_S = 1.0
"""Time after the failure's contact at which an evading ego begins to stop comfortably, s. Ours."""
STOOD_S = 0.5
"""Time for which the ego must have stood so that a walker's contact with it does not count, s, because real walkers
look where they go, but those of the simulation do not. Ours: the duration of a walker's step.
"""
MOST_RUNS = 6
"""Largest number of simulation runs per failure, including the unchanged replay. Ours: it limits the time that a
campaign takes.
"""
