"""The study: runs the campaigns for each of the paper's questions, and writes tables and figures of their results.

Other packages: `fuzz` (DriveFuzz), `selforacle` (the rankers), `faults` (seeded faults), `commands`.
"""
