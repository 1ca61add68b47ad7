"""Files that vary the parameters of a scenario: the sets of values that they mean, and one scenario of all of them."""
