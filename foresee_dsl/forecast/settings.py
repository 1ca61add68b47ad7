"""The forecaster's constants, each with its source."""

from __future__ import annotations

import math
from dataclasses import dataclass

VEHICLE_KINDS = frozenset({"car", "van", "truck", "bus", "motorcycle", "bicycle"})
"""The classes that count as vehicles in the paper's two groups (section 3.2, step 1d); bicycles and motorcycles are
among them."""
PEDESTRIAN_KINDS = frozenset({"pedestrian"})
"""The classes that count as pedestrians. Obstacles are in neither group: without scripted behaviour they are not NPCs
in the paper's sense (section 2), and no operator could act on them."""


@dataclass(frozen=True, slots=True)
class ForeseeSettings:
    """Settings of steps 1a to 1d.

    Attributes:
        vehicle_radius_m: the radius th1 of step 1a (paper, section 4.4).
        pedestrian_radius_m: the radius th2 of step 1a (paper, section 4.4).
        perturbed_radius_m: the threshold of step 1c (paper, section 4.4).
        limited_distance_m: step 1b's "limited distance" between footprints, up to which a crossing actor is critical.
            Ours: 5 m, about a car's length; the ego covers it in half a second in town.
        crossing_angle_rad: angle between two recorded paths below which they do not cross but run along each other.
            Ours, 20 deg: a leader that wanders in the ego's lane stays far below it, a turn through a junction cuts
            well above it.
        path_step_m: spacing to which recorded paths are thinned before they are intersected. Ours: on the tightest turn
            of a car (5 m) half a metre of chord is 6 mm off the arc.
        perturbations: N of step 1c. Ours (the paper prints none): the smallest distance over 20 perturbed trajectories
            differs by less than 2 cm from the smallest over 200, because the errors are small compared with the
            threshold.
        horizon_s: time before the close encounter at which a perturbed trajectory begins. Ours: 3 s, the shorter of the
            paper's two clip offsets, so that every kind of clip contains the whole roll-out.
        beyond_s: time for which a perturbed trajectory continues after the encounter. Ours: 1 s, so that the encounter
            can become closer than it was.
        lateral_error_m, longitudinal_error_m, heading_error_rad: largest deviation of a perturbed trajectory at the end
            of the horizon. Reid et al. 2019 (arXiv 1906.01061), passenger vehicle on local roads, which the paper
            cites: 0.29 m, 0.29 m, 0.50 deg.
        same_encounter_s: two minima of one actor that are less than this time apart are one encounter. Ours: 1 s, the
            raster of the exhaustive baseline.
        prominence_m: two minima count as one if the distance rises by less than this between them, so that jitter of
            standing or side-by-side actors does not count. Ours: 0.1 m, above the sway of a controller that keeps its
            lane and under every threshold.
    """

    vehicle_radius_m: float = 10.0
    pedestrian_radius_m: float = 50.0
    perturbed_radius_m: float = 2.0
    limited_distance_m: float = 5.0
    crossing_angle_rad: float = math.radians(20)
    path_step_m: float = 0.5
    perturbations: int = 20
    horizon_s: float = 3.0
    beyond_s: float = 1.0
    lateral_error_m: float = 0.29
    longitudinal_error_m: float = 0.29
    heading_error_rad: float = math.radians(0.5)
    same_encounter_s: float = 1.0
    prominence_m: float = 0.1

    def radius_m(self, kind: str) -> float:
        """Return step 1a's radius for a class of actor, m; 0 for a class that is ignored."""
        if kind in PEDESTRIAN_KINDS:
            return self.pedestrian_radius_m
        return self.vehicle_radius_m if kind in VEHICLE_KINDS else 0.0
