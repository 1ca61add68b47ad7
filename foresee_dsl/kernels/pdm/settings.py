"""The constants of the `pdm` driver, each with its source.

PDM: Dauner et al. 2023, "Parting with Misconceptions about Learning-based Vehicle Motion Planning" (PDM-Closed: section
3 and its published configuration). IDM: Treiber, Hennecke, Helbing 2000, "Congested traffic states in empirical
observations and microscopic simulations". nuPlan: comfort bounds of the benchmark with which PDM is scored.
"""

from __future__ import annotations

# --- proposals and roll-out -------------------------------------------------------------------------------------
SPEED_SHARES = (1.0, 0.8, 0.6, 0.4, 0.2)
"""Target speeds as shares of the limit (PDM, section 3: 20 % to 100 %); the highest first, so that it wins ties."""
LATERAL_OFFSETS_M = (0.0, 1.0, -1.0)
"""Lateral offsets from the lane's middle, m: PDM, section 3; here limited to the free width."""
HORIZON_S = 4.0
ROLLOUT_STEP_S = 0.1
"""Time step of the roll-outs, s (PDM, section 3: 4 s at 10 Hz)."""
ACCELERATION_STEP_S = 0.2
"""Time for which the IDM's acceleration stays constant in the roll-out, s. Ours: two frames, which halves the cost of
the most expensive part."""

MINIMUM_GAP_M = 2.0
"""Standstill gap to the actor ahead, m: IDM, table I. PDM has 1 m, with which a car stops only 1 m behind a lorry at
every light."""
HEADWAY_S = 1.5
ACCELERATION_MPS2 = 1.5
BRAKING_MPS2 = 3.0
"""Headway, s, acceleration and comfortable braking, m/s^2, of the IDM: PDM's configuration. Table I of the IDM has a
headway T of 1.6 s, an acceleration a of 0.73 m/s^2 and a braking b of 1.67 m/s^2, for motorways."""
KINEMATIC_FACTOR = 1.0
"""The IDM's braking is limited to the larger of `BRAKING_MPS2` and this factor times closing speed^2 / gap. Ours: twice
the braking needed at constant speed; the plain IDM brakes with 8 m/s^2 for a slower car that cuts in 10 m ahead, where
1.7 m/s^2 would be enough."""
PASSABLE_GAP_M = 6.0
"""Distance behind a parked actor at which the ego waits for a gap to pass it, m. Ours: in the tests the ego can steer
out from 4 m behind a car, which leaves a margin of 2 m."""
PASS_CLEARANCE_M = 0.6
"""Lateral clearance to a parked actor that the ego passes, m. Ours; cyclists and opened doors (0.9 m) would need
more."""
CORRIDOR_MARGIN_M = 0.15
"""Lateral clearance on both sides of the ego within which an actor is in its corridor, m. Ours."""
LANE_MARGIN_M = 0.1
"""Distance between the car and the edge of its lanes at the largest offset, m. Ours."""

# --- speed along the route --------------------------------------------------------------------------------------
LATERAL_COMFORT_MPS2 = 2.5
"""Lateral acceleration in curves, m/s^2. Ours: below the 3 m/s^2 that UN R79 allows a lane-keeping system."""
PROFILE_BRAKING_MPS2 = 2.0
"""Braking for curves, lower limits and stop lines, m/s^2. Ours: everyday braking, below the IDM's b."""
PROFILE_PREVIEW_S = 0.3
"""Preview time of the profile, s. Ours: six simulation steps, without oscillation at 20 Hz."""
SENSED_STANDS_MPS = 0.5
"""Measured speed below which a vehicle counts as standing, m/s. Ours: three times the sensors' noise of 0.15 m/s."""
COAST_MPS = 0.1
"""Speed below which a car stands, m/s. Ours."""
HOLD_M = 1.0
HOLD_MPS = 0.3
"""The ego stays where it is, and does not creep to a stop line, if its distance to the line, m, and its speed, m/s, are
below these. Ours."""

# --- prediction -------------------------------------------------------------------------------------------------
ALIGNED_RAD = 0.52
"""Angle to the route, in either direction, within which an actor near it is predicted along the road, rad. Ours: 30
degrees."""
ALIGNED_REACH_M = 6.0
"""Distance from the centreline within which the road bends like the route, m. Ours: one and a half lanes of 3.5 m."""
DRIFT_DEADBAND_RAD = 0.035
"""Heading error below which an actor is not changing lane, rad. Ours: 2 degrees; smaller errors come from the polylines
of the lanes."""
FOE_REACH_M = 1.5
FOE_HEADING_RAD = 0.785
"""An actor within this distance, m, and this angle, rad, of a foe's path is on it. Ours: 1.5 m (half a lane is 1.6 m)
and 45 degrees."""
FOE_EXTENSION_M = 60.0
"""Length of the straight prolongation before a foe's path, m. Ours: at 50 km/h an actor that arrives in 5 s is 70 m
away, and the prolongation covers 60 m of these."""
FOE_STOPS_MPS2 = 3.5
"""Braking up to which an actor that must give way to the ego is expected to stop, m/s^2. Ours: above the 3 m/s^2 of the
amber decision, so that lawful late braking raises no alarm; an actor that will not stop is recognised about 2 s before
the line."""
FOE_ACCELERATION_MPS2 = 1.5
"""Assumed acceleration of a priority vehicle that is slower than the limit, m/s^2: PDM's acceleration."""

PEDESTRIAN_SPEEDS_UP_MPS2 = 0.3
BICYCLE_SPEEDS_UP_MPS2 = 1.0
"""Possible acceleration of a pedestrian or cyclist, m/s^2: the front of the predicted footprint is as far ahead as this
acceleration allows, compared with constant velocity. Ours: about the acceleration of a cyclist who sets off."""

# --- signals and right of way ------------------------------------------------------------------------------------
STOP_MARGIN_M = 0.5
"""Distance of the front bumper before a stop line or conflict zone when the ego stops, m. Ours."""
AMBER_BRAKING_MPS2 = 3.0
"""Braking up to which the ego stops at the onset of amber, m/s^2: ITE's signal timing practice assumes 10 ft/s^2
(3.05 m/s^2)."""
UNSEEN_BRAKING_MPS2 = 2.0
"""Braking up to which the ego stops for a signal that it does not see, m/s^2. Ours: everyday braking; nearer to the
line the ego acts on the colour that it saw last."""
YIELD_BEFORE_S = 1.5
"""Least time between the ego leaving a conflict zone and the arrival of an actor with priority, s. Ours."""
YIELD_AFTER_S = 0.3
"""Least time between that actor leaving and the ego's arrival, s. Ours."""
PEDESTRIAN_AIR_M = 0.8
"""Distance to the lane within which a pedestrian is about to step on it, m. Ours: one stride."""
YIELD_MARGIN_M = 1.0
"""Distance of the waiting front bumper before a conflict zone, m. Ours: the front corners swing out in a turn."""
YIELD_BRAKING_MPS2 = 4.0
"""Braking up to which the ego gives way to vehicles, m/s^2; to pedestrians it gives way with its strongest braking.
Ours."""
AT_WAIT_M = 1.5
"""If the ego is within this distance of its waiting place, m, it assumes that standing vehicles let it go (or have
red); if it is farther away, they may be about to start with the same green. Ours."""
QUEUE_MPS = 1.5
"""Speed below which a vehicle ahead may be the end of a queue that reaches back into the junction, m/s. Ours."""
JUNCTION_REACH_M = 80.0
"""Distance within which junctions are considered, m. Ours: the stopping distance from 50 km/h at 1.5 m/s^2, plus 15
m."""

# --- scoring -----------------------------------------------------------------------------------------------------
PROGRESS_WEIGHT = 5.0
TTC_WEIGHT = 5.0
COMFORT_WEIGHT = 2.0
"""Weights of progress, time to collision and comfort in the score: those of PDM and nuPlan's closed-loop score."""
CLEARANCE_WEIGHT = 2.0
CENTRING_WEIGHT = 1.0
"""Weight of centring in the score. Ours: a 10 % gain of progress (0.5) outweighs one metre of offset (0.33)."""
CENTRING_SCALE_M = 3.0
TTC_S = 0.95
"""Smallest time to collision that a proposal may have, s (nuPlan)."""
CLEARANCE_M = 0.4
PEDESTRIAN_CLEARANCE_M = 0.8
"""Lateral clearance below which a proposal loses clearance points, m. Ours."""
COLLISION_MARGIN_M = 0.15
"""Margin added to footprints, m. Ours: tracking errors measured in the tests are below 0.15 m on straights."""
COMFORT_BRAKING_MPS2 = 4.05
COMFORT_LATERAL_MPS2 = 4.89
"""Bounds of comfortable braking and lateral acceleration, m/s^2: those of nuPlan."""
EMERGENCY_S = 2.0
"""Time to the collision of the best proposal below which PDM brakes in emergency, s."""

# --- tracking ----------------------------------------------------------------------------------------------------
TRACK_TIME_S = 0.75
"""Time constant of the lateral error, s. Ours: an error of one metre then causes 1.8 m/s^2 at any speed."""
TRACK_LENGTH_M = 2.0
"""Shortest length constant of the lateral error, m. Ours: below it the steering rate is the limit."""
OFFSET_LATERAL_MPS2 = 2.0
"""Lateral acceleration of a change of offset, m/s^2. Ours: below `LATERAL_COMFORT_MPS2`."""
CURVATURE_PREVIEW_S = 0.15
"""The curvature of the route this time ahead, s, determines the wheel angle, which compensates for the limited steering
rate. Ours: the best of 0, 0.15 and 0.3 s on turns of 6, 10 and 30 m."""
SMOOTHING_MPS2 = 0.8
"""Largest difference of the requested acceleration from the current one, m/s^2. Ours: with a lag of 0.2 s in the
drivetrain (0.1 s in the brakes) the jerk stays below 4 (8) m/s^3, nuPlan's bound. It does not apply to braking harder
than `BRAKING_MPS2`."""
HOLD_BRAKE = 0.3
"""Brake pedal of a standing car, as a share. Ours."""
FRICTION_SHARE = 0.9
"""Share of the tyres' friction that the driver uses. Ours."""
