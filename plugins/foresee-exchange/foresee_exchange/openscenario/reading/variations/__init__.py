"""Files that vary the parameters of a scenario: their sets of values, merged into one scenario."""
