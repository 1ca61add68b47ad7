"""The constants of the `frenetix` driver, each with its source.

The constants shared with `pdm` (signals, right of way, predictions, distance to others) are in `kernels.pdm.settings`.
Werling: Werling, Ziegler, Kammel, Thrun 2010, "Optimal Trajectory Generation for Dynamic Street Scenarios in a Frenet
Frame", the method that the library implements.
"""

from __future__ import annotations

# --- planning ---------------------------------------------------------------------------------------------------
REPLAN_STEPS = 2
"""Number of steps of 0.05 s between two plans: 10 Hz; other planners of this kind run at 5 to 10 Hz."""
HORIZON_S = 4.0
PLAN_STEP_S = 0.2
"""Time between two frames of a plan, s. Ours: every second frame of the predictions. The car moves 2.8 m between frames
at 50 km/h, less than its length, so that no footprint is skipped; half the frames halve the cost of reading the
samples."""
END_TIMES_S = (2.0, 3.0, 4.0)
"""Durations of a sampled change of speed or lane, s. Ours: below 2 s it is uncomfortable, and nothing is predicted
beyond 4 s."""
SPEED_SHARES = (1.0, 0.75, 0.5, 0.25)
"""Sampled end speeds as shares of the highest speed; the present speed, the speed of the road at this place, and 0 are
sampled too. Ours."""
STOP_SPEED_MPS = 0.02
"""End speed of a stop, m/s. Ours: with exactly 0, rounding makes the last frame run backwards, and frenetix 0.4.0
rejects that."""
LONGEST_STOP_S = 12.0
"""Longest duration of a stop that is sampled, s. Ours: longer stops, and stops beyond the way that the route's highest
speed covers within the horizon, are not considered yet. A plan begins to brake 56 m before the place at 50 km/h, and
stays within the library's coordinates."""
ACCELERATION_MPS2 = 2.5
"""Largest acceleration of a plan, even if the motor has more, m/s^2. Ours: nuPlan calls up to 2.4 m/s^2 comfortable."""
RISE = 0.6
"""Largest mean acceleration of a sample, as a share of the car's largest. Ours: the peak of a quartic is 1.5 times its
mean, so that a tenth remains."""
LOW_SPEED_MPS = 4.0
"""Speed below which the library's low-velocity mode is used (lateral motion over length instead of over time), m/s; the
default of commonroad-reactive-planner (`low_vel_mode_threshold`). Published configurations of other planners of this
family have 2 m/s."""
LEAST_WAY_M = 0.6
"""Shortest way of a lateral motion, m. Ours: shorter ones cannot be computed reliably; braking straight ahead replaces
them."""
CREEP_MPS = 1.0
CREEP_BRAKING_MPS2 = (0.8, 1.6)
"""Braking of the stops straight ahead that are added below the creeping speed, m/s^2. Ours: gentle enough that the car
does not nod."""
HOLD_M = 1.5
"""Distance to its stop place within which a car slower than `CREEP_MPS` stops, m. Ours: the last metre would take five
seconds."""

# --- reference --------------------------------------------------------------------------------------------------
REFERENCE_STEP_M = 1.0
"""Spacing of the points of the route that the library gets, m. Ours: in a bend of 5 m their chords cut it by 0.025
m."""
WINDOW_M = 40.0
BEHIND_M = 10.0
"""Length of the library's coordinates behind the car, m; they are renewed every 40 m. Ours: their cost grows with the
square of the number of points (measured: 2 ms for 120, 200 ms for 850)."""

# --- costs: all in the unit of 1 m/s of mean speed over the horizon ---------------------------------------------
SLOW_WEIGHT = 1.0
FAST_WEIGHT = 12.0
"""Cost per (m/s)^2 above the speed that limit, bend, stop place or leader allow. Ours: the cheapest plan is then only
0.04 m/s too fast."""
HEADWAY_WEIGHT = 8.0
HEADWAY_S = 1.5
"""Wished time gap, s (IDM, table I). `HEADWAY_WEIGHT` is the cost of a gap that is too short, per missing share of the
wished gap, which is the standing gap plus the way in the time gap. Ours."""
REACTION_S = 0.5
"""Reaction time for which the speed leaves room to stop behind a braking leader, s. Ours: about the time in which a
plan changes from cruising to braking. Without it the car touched a leader that stopped with 3 m/s^2."""
OFFSET_WEIGHT = 0.4
"""Cost of each metre from the middle of the lane. Ours: behind a parked actor, setting off at once gains 2.5 m/s, and
the offset of 2.5 m that this needs must cost less."""
LATERAL_JERK_WEIGHT = 0.1
LONGITUDINAL_JERK_WEIGHT = 0.1
"""Weights of lateral and longitudinal jerk: Werling weights jerk with 0.1 against the errors of the end state."""
NEAR_WEIGHT = 3.0
PRESSED_WEIGHT = 3.0
"""Costs of the share of frames with less distance to others than `pdm` requires (`NEAR_WEIGHT`), and of the share with
a lower time to collision than `pdm` requires (`PRESSED_WEIGHT`). Ours."""
DOUBT_MPS = 0.5
DOUBT_M = 1.5
"""Half the length of a moving actor grows by `DOUBT_MPS`, m/s, up to `DOUBT_M`, m. Ours: the error of its speed can be
0.5 m/s."""
CORNER_M = 0.5
"""Half the length of a standing actor is increased by this, m. Ours: the tracking error near its corners is 0.1 m."""
CHANGE_WEIGHT = 0.3
"""Cost per metre between the new plan's end offset and the last one's. Ours: it prevents swaying between two equally
good plans."""
COMFORT_BRAKING_MPS2 = 2.0
"""Braking before a stop or a slower leader, m/s^2. Ours: everyday braking, as in `pdm`."""
MINIMUM_GAP_M = 2.0
"""Standing gap, m: IDM, table I."""
LATERAL_SHARE = 0.6
"""Share of the friction that a plan may use sideways. Ours: the rest is for braking in the bend."""
BATCH = 24
"""Number of the cheapest candidates that are checked for collisions at once. Ours: in free traffic one batch is
enough."""

# --- when nothing is feasible -----------------------------------------------------------------------------------
OLD_PLAN_S = 0.5
"""Age up to which the last plan is still driven if it is free of collisions, s. Ours: in 0.5 s a pedestrian walks 0.7
m, about the distance that a plan keeps."""
EMERGENCY_BRAKING_MPS2 = (3.0, 5.0)
"""Braking that is tried along the present path before the strongest braking, m/s^2. Ours: the braking that amber
requires, and about the hardest of an ordinary driver."""
FADE_M = 5.0
"""Length over which the path of an emergency stop turns parallel to the lane, m. Ours."""

# --- tracking ---------------------------------------------------------------------------------------------------
LAG_S = 0.2
"""Mean delay of drivetrain and brakes, s; the acceleration is read from the plan this much ahead."""
SPEED_GAIN = 1.2
PLACE_GAIN = 0.2
INTEGRAL_GAIN = 0.1
INTEGRAL_LIMIT_MPS2 = 0.4
"""Gains of the PID controller of the speed (1/s, 1/s^2, without unit) and the limit of its integral, m/s^2. Ours: well
damped with the lags of 0.1 and 0.2 s; the limit is enough for a slope of 4 %."""
OFF_PLAN_M = 1.0
OFF_PLAN_SIDE_M = 0.3
OFF_PLAN_MPS = 1.0
OFF_PLAN_RAD = 0.15
"""Deviations from the plan, lengthwise, to the side, in speed and in heading. Above any of them the next plan begins at
the car's own state instead of the last plan's. Ours."""
