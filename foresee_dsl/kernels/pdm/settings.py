"""The constants of the `pdm` driver, each with its source.

PDM: Dauner et al. 2023, "Parting with Misconceptions about Learning-based Vehicle Motion Planning" (PDM-Closed: section
3 and its published configuration). IDM: Treiber, Hennecke, Helbing 2000, "Congested traffic states in empirical
observations and microscopic simulations". nuPlan: the comfort bounds of the benchmark that PDM scores with.
"""

from __future__ import annotations

GRAVITY_MPS2 = 9.81

# --- proposals and roll-out -------------------------------------------------------------------------------------
SPEED_SHARES = (1.0, 0.8, 0.6, 0.4, 0.2)
"""Target speeds as shares of the limit (PDM, section 3: 20 % to 100 %); highest first, so that ties go to it."""
LATERAL_OFFSETS_M = (0.0, 1.0, -1.0)
"""PDM, section 3; bounded here by the free width."""
HORIZON_S = 4.0
ROLLOUT_STEP_S = 0.1
"""PDM, section 3: 4 s at 10 Hz."""
ACCELERATION_STEP_S = 0.2
"""Ours: the IDM's acceleration is held for two frames of the roll-out, which halves the cost of its dearest part."""

MINIMUM_GAP_M = 2.0
"""IDM, table I (PDM uses 1 m, which leaves a car 1 m behind a lorry at every light)."""
HEADWAY_S = 1.5
ACCELERATION_MPS2 = 1.5
BRAKING_MPS2 = 3.0
"""PDM's configuration of the IDM; IDM table I has T 1.6 s, a 0.73, b 1.67 for motorways."""
KINEMATIC_FACTOR = 1.0
"""Ours: the IDM's braking is cut to BRAKING or this times closing speed^2 / gap, twice what is needed at constant
speed: the plain IDM brakes with 8 m/s^2 for a slower car that cuts in 10 m ahead where 1.7 m/s^2 would do."""
PASSABLE_GAP_M = 6.0
"""Ours: how far behind a parked actor the ego waits when there is room to pass but not yet a gap; in the tests it can
steer out from 4 m behind a car, which leaves a margin of 2 m."""
PASS_CLEARANCE_M = 0.6
"""Ours: air beside a parked actor when it is passed; cyclists and opened doors (0.9 m) would need more."""
CORRIDOR_MARGIN_M = 0.15
"""Ours: air on either side of the ego within which an actor counts as being in its corridor."""
LANE_MARGIN_M = 0.1
"""Ours: what an offset leaves between the car and the edge of its lanes."""

# --- speed along the route --------------------------------------------------------------------------------------
LATERAL_COMFORT_MPS2 = 2.5
"""Ours: speed in curves; under the 3 m/s^2 that UN R79 allows a lane-keeping system."""
PROFILE_BRAKING_MPS2 = 2.0
"""Ours: braking for curves, lower limits and stop lines; everyday braking, under the IDM's b."""
PROFILE_PREVIEW_S = 0.3
"""Ours: the profile is met this much ahead; six simulation steps, without ringing at 20 Hz."""
COAST_MPS = 0.1
"""Ours: under this a car stands."""
HOLD_M = 1.0
HOLD_MPS = 0.3
"""Ours: an ego this slow this near to a stop line stays there, and does not creep the rest of the distance."""

# --- prediction -------------------------------------------------------------------------------------------------
ALIGNED_RAD = 0.52
"""Ours: 30 degrees; an actor near the route that heads along or against it within this is predicted along the road."""
ALIGNED_REACH_M = 6.0
"""Ours: how far from the centreline the road still bends like the route: one lane of 3.5 m on and a half."""
DRIFT_DEADBAND_RAD = 0.035
"""Ours: 2 degrees; smaller heading errors come from the polylines of the lanes, not from a change of lane."""
FOE_REACH_M = 1.5
FOE_HEADING_RAD = 0.785
"""Ours: an actor within 1.5 m and 45 degrees of a foe's path is on it (half a lane is 1.6 m)."""
FOE_EXTENSION_M = 60.0
"""Ours: a foe's approach is prolonged straight by this much; at 50 km/h a gap of 5 s is 70 m, the path shows 60 m."""
FOE_STOPS_MPS2 = 3.5
"""Ours: an actor that must give way to the ego is expected to stop while less braking than this is enough. It is above
the 3 m/s^2 of the amber decision, so that lawful late braking raises no alarm; one that will not stop is recognised
about 2 s before the line."""
FOE_ACCELERATION_MPS2 = 1.5
"""PDM's acceleration, taken for a priority vehicle that is slower than the limit."""

PEDESTRIAN_SPEEDS_UP_MPS2 = 0.3
BICYCLE_SPEEDS_UP_MPS2 = 1.0
"""Ours: a pedestrian or cyclist may speed up by this, so that the far end of the predicted footprint runs ahead of
constant velocity; a cyclist who sets off gains about that."""

# --- signals and right of way ------------------------------------------------------------------------------------
STOP_MARGIN_M = 0.5
"""Ours: the front bumper stops this far before a stop line or conflict zone."""
AMBER_BRAKING_MPS2 = 3.0
"""ITE's signal timing practice uses 10 ft/s^2 (3.05 m/s^2) as the braking a driver accepts at the onset of amber."""
UNSEEN_BRAKING_MPS2 = 2.0
"""Ours: braking for a signal that is not seen, as long as no more than this (everyday braking) is needed; nearer to the
line the ego drives on by the colour that it saw last."""
YIELD_BEFORE_S = 1.5
"""Ours: least time from the ego's leaving a conflict zone to the arrival of an actor with priority."""
YIELD_AFTER_S = 0.3
"""Ours: least time from that actor's leaving to the ego's arrival."""
PEDESTRIAN_AIR_M = 0.8
"""Ours: about to step on the lane: within a stride of it."""
YIELD_MARGIN_M = 1.0
"""Ours: the front bumper waits this far before a conflict zone (the front corners swing out in a turn)."""
YIELD_BRAKING_MPS2 = 4.0
"""Ours: an ego that would need more braking than this does not give way any more; for pedestrians the limit is what it
can do."""
AT_WAIT_M = 1.5
"""Ours: nearer to the waiting place than this, standing vehicles are assumed to let the ego go (or to have red);
farther from it they may be about to start with the same green."""
QUEUE_MPS = 1.5
"""Ours: a vehicle ahead slower than this may be the end of a queue that reaches back into the junction."""
JUNCTION_REACH_M = 80.0
"""Ours: junctions nearer than this are considered: the stopping distance from 50 km/h at 1.5 m/s^2, and 15 m."""

# --- scoring -----------------------------------------------------------------------------------------------------
PROGRESS_WEIGHT = 5.0
TTC_WEIGHT = 5.0
COMFORT_WEIGHT = 2.0
"""PDM and nuPlan's closed-loop score."""
CLEARANCE_WEIGHT = 2.0
CENTRING_WEIGHT = 1.0
"""Ours: a 10 % gain of progress (0.5) outweighs one metre of offset (0.33)."""
CENTRING_SCALE_M = 3.0
TTC_S = 0.95
"""nuPlan: least time to collision."""
CLEARANCE_M = 0.4
PEDESTRIAN_CLEARANCE_M = 0.8
"""Ours: lateral air under which a proposal loses its clearance points."""
COLLISION_MARGIN_M = 0.15
"""Ours: footprints grow by this; tracking errors measured in the tests are below 0.15 m on straights."""
COMFORT_BRAKING_MPS2 = 4.05
COMFORT_LATERAL_MPS2 = 4.89
"""nuPlan's comfort bounds."""
EMERGENCY_S = 2.0
"""PDM: emergency braking when the best proposal collides within 2 s."""

# --- tracking ----------------------------------------------------------------------------------------------------
TRACK_TIME_S = 0.75
"""Ours: time constant of the lateral error; one metre then asks 1.8 m/s^2 at any speed."""
TRACK_LENGTH_M = 2.0
"""Ours: shortest length constant; below it the steering rate limits."""
OFFSET_LATERAL_MPS2 = 2.0
"""Ours: lateral acceleration of a change of offset; under LATERAL_COMFORT."""
CURVATURE_PREVIEW_S = 0.15
"""Ours: the wheels are turned for the curvature this much ahead; makes up for the steering rate (best of 0,
0.15 and 0.3 s on turns of 6, 10 and 30 m)."""
SMOOTHING_MPS2 = 0.8
"""Ours: the acceleration asked for differs by no more than this from the present one; with a lag of 0.2 s in the
drivetrain (0.1 s in the brakes) the jerk stays under 4 (8) m/s^3, nuPlan's bound. Not held when braking harder than
BRAKING."""
HOLD_BRAKE = 0.3
"""Ours: brake of a standing car."""
FRICTION_SHARE = 0.9
"""Ours: what the driver uses of the friction it knows of."""
