"""Does searching near misses pay? The paper's questions: which campaigns each needs, what they gave, tables, figures.

Beside them: `fuzz` (DriveFuzz), `selforacle` (the rankers), `faults` (seeded faults), `commands`.
"""
