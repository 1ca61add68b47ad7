"""All kinds of fault by name."""

from __future__ import annotations

import re

from foresee_faults import driving, judging, seeing, yielding
from foresee_faults.fault import Fault

KINDS: dict[str, type[Fault]] = {
    re.sub(r"(?<=[a-z])(?=[A-Z])", "_", kind.__name__).lower(): kind
    for module in (seeing, judging, yielding, driving)
    for kind in vars(module).values()
    if isinstance(kind, type) and issubclass(kind, Fault) and hasattr(kind, "scale")
}
"""All kinds of fault by name, such as `late_objects` for `LateObjects`; each works in every driver of
`driver.HEALTHY`."""
