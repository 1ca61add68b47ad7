"""Benchmark with seeded faults of drivers: it measures which search finds which fault, from which strength on, and at
what cost.

A failure counts as caused by the fault if the faulty driver fails a mutant and the healthy driver passes the same
mutant. The faulty drivers are the plug-in in `plug_in/`, which is never installed; `docs/background/faults.md` explains
how to read the results.
"""
