"""The ranker `reach`: when a change of which actor, by which operator, could still reach the ego as it drives."""
