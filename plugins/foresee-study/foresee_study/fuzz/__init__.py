"""DriveFuzz (Kim et al., CCS 2022) on test cases of this language: whole scenes are mutated, and the worst drive is
mutated again. It knows nothing of risky points: it is what forecasting is compared with.

Begin reading at `engine.py`.
"""
