"""Benchmark with seeded faults of drivers: which search finds which fault, down to which strength, and at what cost.

A failing child that the faulty driver fails and the healthy one passes is the fault's, by construction. The drivers are
the plug-in in `plug_in/`, which is never installed; `docs/background/faults.md` says how all of this is read.
"""
