"""Clips: the seconds around a risky point, restated as a file that rebuilds them exactly."""
