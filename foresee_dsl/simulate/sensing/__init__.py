"""The driver's sensors: they limit observations by range, field of view, occlusion, latency and noise.

`Sensing` is created once a run and called once a frame. Modules, in the order of a measurement: `weather` (ranges),
`sight` (objects in sight), `noise` and `objects` (the object list and its track numbers), `perception` (observations
and signals), `views` (pictures); `settings` has the parameters. The computations for each object in each scan are in
the compiled modules `kernels.sight`, `noise` and `object_list`.
"""

from __future__ import annotations

from foresee_dsl.simulate.sensing.perception import Sensing
from foresee_dsl.simulate.sensing.settings import IDEAL, STANDARD, SensorSettings

__all__ = ["IDEAL", "STANDARD", "Sensing", "SensorSettings"]
