"""What the parts of a run hand on within one frame."""

from __future__ import annotations

from dataclasses import dataclass, field

from foresee_dsl.drivers.protocol import Control, Observation
from foresee_dsl.kernels.arrays import FloatArray
from foresee_dsl.simulate.results.outcome import Decision


@dataclass(slots=True)
class Frame:
    """One frame of a run. The loop makes it and hands it from part to part; each part writes what the next ones read.

    Attributes:
        time_s: since the run began; orders of the director are given before anything else is written.
        states: [1 + N, 7] the columns of `Trace.states` for the ego and the others, NaN where absent: by the recorder.
        observation: what the driver may look at: by the sensors.
        decision: how the run ends at this frame, None where it goes on: by the judge, the driver's fault, or SUMO's.
        control: the driver's answer: by the driver.
    """

    time_s: float
    states: FloatArray = field(init=False)
    observation: Observation = field(init=False)
    decision: Decision | None = None
    control: Control = field(init=False)
