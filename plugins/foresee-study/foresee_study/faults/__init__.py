"""Seeded faults, the ground truth: which search finds which fault of a driver, how weak it may be, and at what cost.

A failing child that the faulty driver fails and the healthy one passes is the fault's, by construction. The drivers are
the plug-in in `plug_in/`, which is never installed; `docs/background/faults.md` says how all of this is read.
"""
