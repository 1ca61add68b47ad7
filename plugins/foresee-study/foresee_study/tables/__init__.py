"""The tables of a study, in the paper's layout, computed from the results of its campaigns."""
