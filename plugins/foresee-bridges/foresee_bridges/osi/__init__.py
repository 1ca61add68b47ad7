"""Runs as ASAM OSI traces (`foresee export osi`): ground truth, sensor view and traffic update, as `.osi` or MCAP."""
