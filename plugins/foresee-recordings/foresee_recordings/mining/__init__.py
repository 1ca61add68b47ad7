"""Mining: situations that conditions of the language, or detectors on tracks, find in a recording.

`traffic` resamples a recording, `rows` pairs its actors, `conditions` evaluates a condition for all pairs and frames at
once, `query` and `named` are what can be searched for, and `search` finds the situations.
"""
