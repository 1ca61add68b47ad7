"""What the driver perceives: only what its sensors' range, view, latency and noise leave, and what nothing hides.

`Sensing` is made once a run and asked once a frame. Modules, in the order of a measurement: `weather` (ranges), `walls`
and `sight` (who is in sight), `noise` and `objects` (the object list), `tracks`, `signals`; `settings` has the numbers.
What is computed for each object in each scan is in `kernels.sight`, `noise` and `object_list`, which are
compiled.
"""

from __future__ import annotations

from foresee_dsl.simulate.sensing.perception import Sensing
from foresee_dsl.simulate.sensing.settings import IDEAL, STANDARD, SensorSettings

__all__ = ["IDEAL", "STANDARD", "Sensing", "SensorSettings"]
