"""The ranker `reach`: it finds which change of which actor, and from when on, could still hit the ego as it drove."""
