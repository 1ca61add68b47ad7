"""Criticality measures as formulas: each function takes arrays of values at moments, and returns the measure at each
moment.

Overview of most: Westhofen et al., "Criticality Metrics for Automated Driving" (Archives of Computational Methods in
Engineering, 2023). Where a formula was not compared with the text of its source, its docstring says so.
`simulate.results.criticality` applies the formulas to a run.
"""

from __future__ import annotations

import numpy as np

from foresee_dsl.kernels.arrays import FloatArray
from foresee_dsl.kernels.boxes import IntArray
from foresee_dsl.kernels.constants import HARDEST_BRAKING_MPS2

STEERING_MPS2 = HARDEST_BRAKING_MPS2
"""Largest lateral acceleration of an evasion, m/s^2. Ours: the grip of the hardest braking, as on a friction circle."""
RSS_RESPONSE_S = 1.0
"""Time within which a vehicle responds, s. This and the next seven values: defaults of ad-rss-lib in CARLA's RSS
sensor, as users of both repeat them; the paper (see `rss_distance`) leaves them open."""
RSS_ACCELERATION_MPS2 = 3.5
"""Largest acceleration during the response, m/s^2."""
RSS_BRAKING_MPS2 = 4.0
"""Least braking of the vehicle behind after its response, m/s^2."""
RSS_HARDEST_BRAKING_MPS2 = 8.0
"""Hardest braking of the vehicle ahead, m/s^2."""
RSS_CORRECT_BRAKING_MPS2 = 3.0
"""Least braking of a vehicle in its own lane when another comes towards it, m/s^2."""
RSS_LATERAL_MPS2 = 0.2
"""Largest lateral acceleration during the response, m/s^2."""
RSS_LATERAL_BRAKING_MPS2 = 0.8
"""Least lateral braking after the response, m/s^2."""
RSS_FLUCTUATION_M = 0.1
"""Lateral movement that RSS ignores, m."""
_KMH = 3.6
_MPH = 3600.0 / 1609.344


def time_headway(gap_m: FloatArray, time_s: FloatArray, along_m: FloatArray, frames: IntArray) -> FloatArray:
    """Return the time until the ego's front is where the rear of the actor ahead is now, s; infinite if it never is.

    The ego is followed as it drove, and from the run's end on at its last speed. Source: Westhofen et al., section on
    THW; it is also CommonRoad-CriMe's definition, which ends at the end of the recorded motion.

    Args:
        gap_m: [N] room between front and rear along the ego's path. time_s: [T] times. along_m: [T] distance that the
            ego has driven. frames: [N] indices into the last two.
    """
    place = along_m[frames] + gap_m
    reached = np.searchsorted(along_m, place, side="left")
    after = np.minimum(reached, len(along_m) - 1)
    before = np.maximum(after - 1, 0)
    step_m, step_s = along_m[after] - along_m[before], time_s[after] - time_s[before]
    with np.errstate(divide="ignore", invalid="ignore"):
        times = time_s[after] + np.where(step_m > 0, (place - along_m[after]) / step_m * step_s, np.inf)
    # The ego is at the place already, or the place is beyond the end of a run that ends with a stand.
    times = np.where(gap_m <= 0, time_s[frames], times)
    headway: FloatArray = times - time_s[frames]
    return headway


def braking_required(ttc_s: FloatArray, closing_mps: FloatArray, other_mps2: FloatArray) -> FloatArray:
    """Return the braking with which the ego's closing speed becomes zero where both would touch, m/s^2; 0 if none.

    v / (2 TTC) - a_other, which for actors in line is v^2 / (2 gap) - a_other. Source: Jansson, "Collision Avoidance
    Theory" (PhD thesis, Linköping, 2005), section 5.3.5; without the other's acceleration it is DRAC (Cooper and
    Ferguson, 1976). Not compared with the texts.

    Args:
        ttc_s: time to collision at constant speeds. closing_mps: relative speed along the ego's heading.
        other_mps2: acceleration of the other along the ego's heading.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        required = np.where(closing_mps > 0, closing_mps / (2 * ttc_s) - other_mps2, 0.0)
    braking: FloatArray = np.maximum(required, 0.0)
    return braking


def brake_threat_number(required_mps2: FloatArray, possible_mps2: float = HARDEST_BRAKING_MPS2) -> FloatArray:
    """Return the required braking as a share of the possible one; from 1 on, braking alone does not suffice.

    Source: Åsljung et al., "Using extreme value theory for vehicle level safety validation" (IEEE Transactions on
    Intelligent Vehicles, 2017), equation 9, as CommonRoad-CriMe cites it.
    """
    return required_mps2 / possible_mps2


def time_to_brake(ttc_s: FloatArray, closing_mps: FloatArray, braking_mps2: float = HARDEST_BRAKING_MPS2) -> FloatArray:
    """Return for how long the hardest braking can still wait, s; a negative time says how long ago it should have
    begun.

    TTC - v / (2 b). NaN if the ego does not close the gap, so that braking does not help. Source: Hillenbrand et al.,
    "A Multilevel Collision Mitigation Approach" (IEEE Transactions on Intelligent Transportation Systems, 2006); the
    closed form assumes that the other keeps its speed. Not compared with the text.
    """
    return np.where(closing_mps > 0, ttc_s - closing_mps / (2 * braking_mps2), np.nan)


def time_to_steer(ttc_s: FloatArray, aside_m: FloatArray, lateral_mps2: float = STEERING_MPS2) -> FloatArray:
    """Return for how long the hardest evasion can still wait, s; a negative time says how long ago it should have
    begun.

    TTC - sqrt(2 y / a), y being the shorter way aside to pass the other where both would touch, without regard to the
    road's edge or to others. Source: Hillenbrand et al., as for `time_to_brake`. Not compared with the text.
    """
    return ttc_s - np.sqrt(2 * np.maximum(aside_m, 0.0) / lateral_mps2)


def time_to_react(brake_s: FloatArray, steer_s: FloatArray) -> FloatArray:
    """Return for how long a reaction can still wait: the later of time to brake and time to steer, s.

    Source: Tamke, Dang and Breuel, "A flexible method for criticality assessment in driver assistance systems" (IEEE
    Intelligent Vehicles Symposium, 2011). Their measure also counts a reaction by accelerating, which ours does not.
    """
    later: FloatArray = np.fmax(brake_s, steer_s)
    return later


def rss_distance(behind_mps: FloatArray, ahead_mps: FloatArray) -> FloatArray:
    """Return the safe longitudinal distance of responsibility-sensitive safety, m.

    Source: Shalev-Shwartz, Shammah and Shashua, "On a Formal Model of Safe and Scalable Self-driving Cars" (2017),
    lemma 2 for the same direction, lemma 3 for opposite ones. Not compared with the text.

    Args:
        behind_mps: speed of the ego. ahead_mps: speed of the actor ahead in the ego's direction; negative: towards it.
    """
    rho = RSS_RESPONSE_S
    fast, met = behind_mps + rho * RSS_ACCELERATION_MPS2, -ahead_mps + rho * RSS_ACCELERATION_MPS2
    response = (behind_mps + fast) / 2 * rho
    same = response + fast**2 / (2 * RSS_BRAKING_MPS2) - ahead_mps**2 / (2 * RSS_HARDEST_BRAKING_MPS2)
    towards = response + fast**2 / (2 * RSS_CORRECT_BRAKING_MPS2) + (met - ahead_mps) / 2 * rho
    towards = towards + met**2 / (2 * RSS_BRAKING_MPS2)
    return np.where(ahead_mps < 0, towards, np.maximum(same, 0.0))


def rss_lateral_distance(ego_mps: FloatArray, other_mps: FloatArray) -> FloatArray:
    """Return the safe lateral distance of responsibility-sensitive safety, m; speeds are positive towards each other.

    Source: as for `rss_distance`, lemma 4.
    """

    def way(speed: FloatArray) -> FloatArray:
        fast = speed + RSS_RESPONSE_S * RSS_LATERAL_MPS2
        return (speed + fast) / 2 * RSS_RESPONSE_S + fast * np.abs(fast) / (2 * RSS_LATERAL_BRAKING_MPS2)

    distance: FloatArray = RSS_FLUCTUATION_M + np.maximum(way(ego_mps) + way(other_mps), 0.0)
    return distance


def delta_v(relative_mps: FloatArray, own_kg: float, other_kg: float) -> FloatArray:
    """Return by how much the ego's velocity would change in a fully plastic contact, m/s.

    m_other / (m_ego + m_other) times the size of the relative velocity. Source: Shelby, "Delta-V as a Measure of
    Traffic Conflict Severity" (International Conference on Road Safety and Simulation, 2011). Not compared with the
    text.

    Args:
        relative_mps: size of the relative velocity. own_kg, other_kg: masses; infinite for a fixed obstacle.
    """
    return relative_mps * (1.0 if np.isinf(other_kg) else other_kg / (own_kg + other_kg))


def serious_injury_risk(delta_v_mps: FloatArray) -> FloatArray:
    """Return the probability that an occupant is injured seriously or worse (MAIS 3 and more), 0 to 1.

    1 / (1 + exp(6.954 - 0.1637 delta-v / mph)). Source: NHTSA, "MAIS(05/08) Injury Probability Curves as Functions of
    Delta V" (DOT HS 813 219, 2022), curve of all crashes; coefficients as users of the report repeat them.
    """
    return _logistic(-6.954, 0.1637, delta_v_mps * _MPH)


def pedestrian_fatality_risk(impact_mps: FloatArray) -> FloatArray:
    """Return the probability that an adult on foot dies when the front of a car strikes with this speed, 0 to 1.

    1 / (1 + exp(6.9 - 0.090 v / (km/h))). Source: Rosén and Sander, "Pedestrian fatality risk as a function of car
    impact speed" (Accident Analysis and Prevention, 2009). It gives 8 % at 50 km/h, more than five times the risk at 30
    km/h, as their abstract says.
    """
    return _logistic(-6.9, 0.090, impact_mps * _KMH)


def _logistic(intercept: float, slope: float, values: FloatArray) -> FloatArray:
    risk: FloatArray = 1.0 / (1.0 + np.exp(-(intercept + slope * values)))
    return risk
