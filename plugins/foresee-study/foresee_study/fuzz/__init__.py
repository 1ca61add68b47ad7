"""DriveFuzz (Kim et al., CCS 2022) for test cases of this language, with which forecasting is compared.

It mutates whole scenes, and mutates the worst drive again; it does not use risky points. Begin reading at `engine.py`.
"""
