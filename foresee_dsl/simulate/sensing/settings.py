"""What the sensors can do: ranges, fields of view, occlusion, latency, noise. Two presets: STANDARD and IDEAL.

The figures are those of a roof lidar, surround cameras and a fusion, as public benchmarks and data sheets have them.
"Ours" marks what was chosen for lack of a figure.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field


@dataclass(frozen=True)
class ClassRanges:
    """How far the centre of an object of a class is seen in clear air, m.

    The nuScenes detection benchmark counts cars, lorries and buses up to 50 m, two-wheelers and pedestrians up to
    40 m, barriers and cones up to 30 m (its `class_range`), with a lidar of 32 layers. Ours: its order of classes, and
    more metres, as lidars of 128 layers have them: cars as far as here before (80 m), the rest in proportion or a
    little above, rounded.
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
    """Standard deviations of what is measured of an object. No error is larger than six of them.

    Ours: a car at 25 m is 0.21 m off in the mean, as lidar detectors with a tracker are; we expect of those without
    one a mean error of position of 0.2 m to 0.3 m, of velocity of 0.2 m/s to 0.3 m/s, and of size of 15 % to 25 % of
    the common volume (the measures mATE, mAVE and mASE of the nuScenes benchmark).

    Attributes:
        radial_m, radial_share: along the line of sight: a constant, and a share of the distance.
        lateral_m, lateral_rad: across it: a constant, and an angle.
        heading_rad: of vehicles. pedestrian_heading_rad: of people, who look alike from all sides.
        speed_mps, speed_share, speed_most_mps: of one that stands; what is added as a share of its speed; the most.
        size_share: of length and width each.
        slow_share: how much of the variance of position, heading and speed drifts over `slow_s`; the rest is new in
            each frame. Trackers smooth the latter away, not the former. The error of size drifts as a whole.
        slow_s: spacing of the drift's knots.
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
    """How often an object in view is missed: `least`, and up to `most` more at the end of its range.

    Ours: `least + most * (distance / range) ** steepness`, range as the weather leaves it. Detectors find nearly
    everything that is near and lose half of it within the last tenths of their range.

    Attributes:
        lasts_s: a miss lasts so long. Ours: two scans of a lidar at 10 Hz.
    """

    least: float = 0.01
    most: float = 0.40
    steepness: float = 4.0
    lasts_s: float = 0.2


@dataclass(frozen=True)
class Localisation:
    """Error of the ego's own pose: standard deviations, and how fast it drifts.

    Reid et al. 2019 (arXiv 1906.01061) ask for 0.29 m and 0.50 deg with 95 % on local roads as the least that lane
    keeping needs. Ours: 0.05 m on each axis (0.12 m with 95 %) and 0.2 deg (0.4 deg with 95 %), well within it.

    Attributes:
        drifts_s: spacing of the drift's knots; ours.
    """

    position_m: float = 0.05
    heading_rad: float = math.radians(0.2)
    drifts_s: float = 2.0


@dataclass(frozen=True)
class SensorSettings:
    """What the driver's sensors can do.

    Attributes:
        ranges: by class. field_of_view_rad: horizontal, about the ego's heading.
        eye_m: height of the sensors over the ego's centre; ours: on the roof of a car.
        seen_share: an object is seen while at least this share of its points is in line of sight (corners and centre
            at `high_share` and at `low_share` of its height). Ours: 3 of 10 points, such as the heads of people behind
            a car; one corner of five is not enough. 0: nothing hides anything.
        scan_s: time between two measurements, at whole multiples of it in the time of the run that a clip was cut
            from; in between the driver has the last one. Lidars turn with 10 Hz.
        latency_s: from a measurement to the driver; whole frames (0.05 s). Ours: as long as a scan.
        forgets_s: an object that was not seen for longer gets a new track.
        signal_range_m: from the ego's centre to the signal's head; braking from 70 km/h in comfort takes 65 m, and a
            second to decide. signal_view_rad: field of view of the camera for signals, forward; ours, a wide-angle one.
        weather: whether rain, fog and sun change anything.
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
"""What a run has when none are given."""

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
"""Everything that is seen is measured exactly."""
NO_DROPOUTS = Dropouts(least=0.0, most=0.0)
"""Everything that can be seen is seen."""
EXACT = Localisation(position_m=0.0, heading_rad=0.0)
"""The ego knows where it is."""

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
"""Everybody within 80 m, exactly and at once, through walls: to tell what a driver owes to its sensors, and for
tests."""
