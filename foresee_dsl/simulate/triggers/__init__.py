"""The triggers of a scenario in a run: their conditions, their actions, and the state of both."""
