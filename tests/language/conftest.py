"""Hypothesis profiles: how many examples the property tests try.

`default` (CI, `make test`) tries `test_properties.EXAMPLES`, the same ones each time. A longer run draws new ones:
`FORESEE_EXAMPLES=50000 pytest tests/language/test_properties.py` or `--hypothesis-profile=long`.
"""

from __future__ import annotations

from hypothesis import HealthCheck, settings

_ALWAYS = {"deadline": None, "database": None, "suppress_health_check": list(HealthCheck)}

settings.register_profile("default", derandomize=True, **_ALWAYS)
settings.register_profile("long", derandomize=False, print_blob=True, **_ALWAYS)
settings.load_profile("default")
