"""The constants of the anticipating driver, each with its source.

IEEE 2846-2022 lists which properties of other road users a safety model has to bound (speed, acceleration, braking,
heading, lateral motion) and leaves the values to its user; the values here are therefore of other sources, or ours.
"""

from __future__ import annotations

import math

COMFORTABLE_MPS2 = 3.4
"""Comfortable braking of most drivers on wet roads too: AASHTO, A Policy on Geometric Design of Highways and Streets,
stopping sight distance. It is tried first; also the braking that others may be expected to use where they must wait."""
FIRM_MPS2 = 5.0
"""Firm braking, tried second: R157 calls more than this an emergency manoeuvre."""
BUILDS_UP_S = 0.6
"""Braking of any strength builds up in this time: R157, Annex 4, appendix 3 (0.774 g after 0.6 s)."""
EASES_MPS2 = 2.0
"""How an anticipating driver slows for what might happen. Ours: the braking of the Intelligent Driver Model for towns
is 1.5 to 2 m/s^2 (Treiber and Kesting, Traffic Flow Dynamics, table 11.2); lifting the foot and a light touch."""
SETS_OFF_MPS2 = 1.5
"""How it speeds up again. Ours: as the Intelligent Driver Model in a town."""

EXPECTED_REACTION_S = 0.75
"""Reaction of a driver who expects something, foot over the brake: Green, How Long Does It Take to Stop?
(Transportation Human Factors, 2000), 0.70 to 0.75 s; the same as R157's delay, without its evaluation time."""

LATERAL_MPS2 = 3.0
"""The largest lateral acceleration of evading: as UN R79 allows steering assistance in cars (category B1); its text was
not at hand."""
LATERAL_JERK_MPS3 = 5.0
"""The largest lateral jerk of evading: likewise; R79 takes the mean over half a second, this every moment."""
SIDESTEPS_M = (0.4, 0.8, 1.2, 1.6, 2.0, 2.5, 3.0, 3.5)
"""How far sideways is tried, either way, m. Ours: from a swerve within the lane to a lane's width."""

FORESEES_S = 1.45
"""Others are predicted for the time that comfortable braking takes, and this much longer: R157's evaluation (0.4 s) and
delay (0.75 s), and half of the build-up."""
GAP_ACCEPTED_S = 4.1
"""Others are predicted at least this far ahead: Highway Capacity Manual, base critical headway of left turns from a
major street. Measured: without it, a driver that had stopped for the first oncoming car set off in front of the
second."""
WALKER_HASTENS_MPS = 0.5
"""A walker is predicted to become up to this much faster or slower. Ours: two thirds of the way from walking
to running (`WALKING_MPS`, `RUNNING_MPS`)."""
CROSSES_RAD = math.radians(45)
"""A vehicle whose heading differs by more than this from the ego's is crossing or oncoming, and is expected to wait
where it can do so with comfortable braking. Ours: 45 degrees, as `MERGES_RAD` of R157's model."""
GAP_S = 0.5
"""Two road users that come through one place within this time of each other are in conflict. Ours: post-encroachment
times under 1 s are serious in conflict studies; the predicted boxes add the ego's length."""
FORGETS_S = 1.0
"""A conflict that is interrupted for less than this goes on as the same one. Ours: as long as sensors keep a track."""

WALKING_MPS = 1.39
"""5 km/h: Euro NCAP, AEB VRU protocol, walking adult and obstructed child."""
RUNNING_MPS = 2.22
"""8 km/h: Euro NCAP, AEB VRU protocol, running adult: who gets off or catches a bus."""
BESIDE_M = 3.0
"""A stopped vehicle whose side is nearer than this to the ego's side can hide somebody. Ours: a lane's width."""
HIDES_M = 1.2
"""A standing object narrower than this hides nobody. Ours: a skip and a parked car do, a cone and a cabinet do not."""
KERB_M = 2.0
"""A standing walker nearer than this to the ego's side may step out. Ours: a kerb, and a step from it."""
CLOSE_M = 1.0
"""A walker nearer than this to the ego's side is passed with care, wherever it walks to. Ours, measured: with walkers
predicted to turn by 15 degrees at any time, the driver stopped 19 m before a walker who went along the kerb."""
AT_CROSSING_M = 3.0
"""A walker this near to a crossing on the ego's way, where walkers go first, may want to cross. Ours: two steps. German
law (StVO 26) asks for moderate speed there, and to wait."""
NEAR_VEHICLE_M = 5.0
"""Walkers this near to a stopped vehicle belong to it. Ours: a car's length."""
SLOWEST_MPS = 30 / 3.6
"""The driver does not go slower than this for what might happen. Ours, after the zones of 30 km/h in which such streets
lie."""
SLOWEST_AT_BUS_MPS = 20 / 3.6
"""The same past a bus at its stop, or past a stopped vehicle with people near it. Ours: German law (StVO 20) asks for a
speed at which one can stop for who steps out, and for walking pace past a bus with its hazard lights on."""
HEADWAY_S = 2.0
"""The two-second rule behind another vehicle: The Highway Code (UK), rule 126."""
HARDEST_MPS2 = 7.0
"""The braking that the driver counts on when it chooses its speed past hidden places. Ours: R157's 0.774 g less a
tenth, for the build-up."""

TURNING_RAD = math.radians(20)
"""A driver that turns by more than this within the predicted time looks over its shoulder: others that come from behind
beside it are considered.
Ours: 20 degrees, as `CROSSING_RAD` of the near misses."""

STANDS_MPS = 0.3
"""An actor slower than this counts as standing. Ours: a tenth of walking pace above SUMO's threshold."""

MARGIN_M = 0.3
"""Least distance to everybody that the pre-screening asks of braking. Ours: a step of a fast car's sideways error."""
MARGIN_ASIDE_M = 0.5
"""Least distance to everybody that it asks of evading. Ours."""
CLEAR_M = 0.1
"""A confirming run that comes nearer than this to anybody prevents nothing: chance decides. Ours."""
LOOKS_ON_S = 3.0
"""A confirming run goes on for this long after the failure's contact. Ours: by then an ego that brakes comfortably from
50 km/h has stood for a while, and the other has passed."""
PASSES_S = 1.0
"""An ego that evades keeps going until this long after the failure's contact, then stops comfortably. Ours."""
STOOD_S = 0.5
"""A real walker would not have walked into an ego that had stood for this long; walkers of the simulation do not look.
Ours: a step."""
MOST_RUNS = 6
"""Runs in the real simulation for one failure, the unchanged replay included. Ours: the campaign's time."""
