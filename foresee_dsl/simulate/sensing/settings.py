"""Settings of the sensors: ranges, fields of view, occlusion, latency, noise. It has two presets, STANDARD and IDEAL.

The values are those of a roof lidar, surround cameras and their fusion, from public benchmarks and data sheets. "Ours"
marks a value that was chosen because none was published.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field


@dataclass(frozen=True)
class ClassRanges:
    """Range within which the centre of an object is seen in clear air, by class, m.

    The nuScenes detection benchmark counts cars, lorries and buses up to 50 m, two-wheelers and pedestrians up to 40 m,
    barriers and cones up to 30 m (its `class_range`), with a lidar of 32 layers. Ours: the same order of classes with
    longer ranges, as of lidars with 128 layers: 80 m for cars; the ranges of the other classes are in proportion or
    slightly larger, and rounded.
    """

    car: float = 80.0
    van: float = 80.0
    truck: float = 100.0
    bus: float = 100.0
    motorcycle: float = 65.0
    bicycle: float = 60.0
    pedestrian: float = 55.0
    obstacle: float = 50.0


@dataclass(frozen=True)
class ObjectNoise:
    """Standard deviations of the measurements of an object. No error is larger than six standard deviations.

    Ours: the mean position error of a car at 25 m is 0.21 m, as that of lidar detectors with a tracker. For detectors
    without a tracker we expect mean errors of 0.2 m to 0.3 m in position, of 0.2 m/s to 0.3 m/s in velocity, and of
    15 % to 25 % of the common volume in size (the measures mATE, mAVE and mASE of the nuScenes benchmark).

    Attributes:
        radial_m, radial_share: error of the position along the line of sight: a constant, and a share of the distance.
        lateral_m, lateral_rad: error of the position across the line of sight: a constant, and an angle.
        heading_rad: error of a vehicle's heading. pedestrian_heading_rad: that of a pedestrian's heading, which is
            larger, as pedestrians look alike from all sides.
        speed_mps, speed_share, speed_most_mps: error of the speed: that of a standing object; what is added, as a share
            of the object's speed; the largest error.
        size_share: error of length and width, as a share of each.
        slow_share: share of the variance of position, heading and speed that drifts over `slow_s`; the rest is
            independent in each frame. A tracker smooths out the independent part only. The error of size only drifts.
        slow_s: time between two knots of the drift.
    """

    radial_m: float = 0.10
    radial_share: float = 0.003
    lateral_m: float = 0.05
    lateral_rad: float = math.radians(0.25)
    heading_rad: float = math.radians(2.0)
    pedestrian_heading_rad: float = math.radians(10.0)
    speed_mps: float = 0.03
    speed_share: float = 0.03
    speed_most_mps: float = 0.2
    size_share: float = 0.05
    slow_share: float = 0.5
    slow_s: float = 1.0


@dataclass(frozen=True)
class Dropouts:
    """Probability that an object in view is missed: `least`, plus up to `most` at the end of the range.

    Ours: the probability is `least + most * (distance / range) ** steepness`, with the range in the current weather.
    Detectors find nearly all near objects and lose half of the objects within the last tenths of their range.

    Attributes:
        lasts_s: duration of a miss, s. Ours: two scans of a lidar at 10 Hz.
    """

    least: float = 0.01
    most: float = 0.40
    steepness: float = 4.0
    lasts_s: float = 0.2


@dataclass(frozen=True)
class Localisation:
    """Errors of the ego's estimated pose: their standard deviations, and the speed of their drift.

    Reid et al. 2019 (arXiv 1906.01061) require 0.29 m and 0.50 deg at 95 % on local roads as the minimum for lane
    keeping. Ours: 0.05 m on each axis (0.12 m at 95 %) and 0.2 deg (0.4 deg at 95 %), well within it.

    Attributes:
        drifts_s: time between two knots of the drift, s; ours.
    """

    position_m: float = 0.05
    heading_rad: float = math.radians(0.2)
    drifts_s: float = 2.0


@dataclass(frozen=True)
class SensorSettings:
    """Settings of the driver's sensors.

    Attributes:
        ranges: ranges by class. field_of_view_rad: horizontal field of view about the ego's heading.
        eye_m: height of the sensors above the ego's centre; ours: on the roof of a car.
        seen_share: least share of an object's points that must be in line of sight (corners and centre at `high_share`
            and at `low_share` of its height). Ours: 3 of 10 points, so that people behind a car are seen if their heads
            show; one corner of five is not enough. 0: nothing hides an object.
        scan_s: time between two measurements, s. They take place at multiples of this time, counted in the run from
            which a clip was cut; in between, the driver gets the last measurement again. Lidars turn with 10 Hz.
        latency_s: time from a measurement to the driver, in whole frames (0.05 s). Ours: one scan.
        forgets_s: time without a sighting after which an object gets a new track.
        signal_range_m: range from the ego's centre to a signal's head; comfortable braking from 70 km/h takes 65 m, and
            the driver needs a second to decide. signal_view_rad: field of view of the forward signal camera; ours, a
            wide-angle one.
        weather: whether rain, fog and sun affect the sensors.
    """

    ranges: ClassRanges = field(default_factory=ClassRanges)
    field_of_view_rad: float = math.radians(360.0)
    eye_m: float = 1.6
    seen_share: float = 0.25
    high_share: float = 0.95
    low_share: float = 0.5
    scan_s: float = 0.1
    latency_s: float = 0.1
    forgets_s: float = 1.0
    noise: ObjectNoise = field(default_factory=ObjectNoise)
    dropouts: Dropouts = field(default_factory=Dropouts)
    localisation: Localisation = field(default_factory=Localisation)
    signal_range_m: float = 100.0
    signal_view_rad: float = math.radians(120.0)
    weather: bool = True


STANDARD = SensorSettings()
"""The default sensors of a run."""

NO_NOISE = ObjectNoise(
    radial_m=0.0,
    radial_share=0.0,
    lateral_m=0.0,
    lateral_rad=0.0,
    heading_rad=0.0,
    pedestrian_heading_rad=0.0,
    speed_mps=0.0,
    speed_share=0.0,
    size_share=0.0,
)
"""Exact measurements."""
NO_DROPOUTS = Dropouts(least=0.0, most=0.0)
"""No object in view is missed."""
EXACT = Localisation(position_m=0.0, heading_rad=0.0)
"""Exact localisation."""

IDEAL = SensorSettings(
    ranges=ClassRanges(80.0, 80.0, 80.0, 80.0, 80.0, 80.0, 80.0, 80.0),
    seen_share=0.0,
    scan_s=0.05,
    latency_s=0.0,
    noise=NO_NOISE,
    dropouts=NO_DROPOUTS,
    localisation=EXACT,
    signal_view_rad=math.radians(360.0),
    weather=False,
)
"""Sensors that measure all actors within 80 m exactly, without latency, and through walls: to separate a driver's
failures from those of its sensors, and for tests."""
