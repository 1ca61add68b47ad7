"""Triggers: their conditions, their actions, and the state of both while a run goes on."""
