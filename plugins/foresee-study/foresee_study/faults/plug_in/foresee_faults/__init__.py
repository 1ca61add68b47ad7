"""Drivers with seeded faults: `fault:pdm/late_objects@0.4` is `pdm` with the fault `late_objects` at a strength of 0.4.

A plug-in of its own that is never installed: the benchmark puts its folder on the path.
"""
