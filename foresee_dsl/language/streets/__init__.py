"""Where things on a written network's roads are: which pieces edges are cut into, and what each roundabout joins."""
