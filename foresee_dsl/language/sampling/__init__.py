"""Draws cases of logical scenarios, evaluates `require`, and computes how much of the parameters' ranges the cases
cover."""
