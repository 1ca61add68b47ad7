"""Places the actors of a test case at the first frame, and checks whether they fit the network."""
