"""DriveFuzz (Kim et al., CCS 2022) on test cases of this language: it mutates whole scenes, and mutates the worst drive
again. It does not use risky points: forecasting is compared with it.

Begin reading at `engine.py`.
"""
