"""Triggers: their conditions, their actions, and the state of both during a run."""
