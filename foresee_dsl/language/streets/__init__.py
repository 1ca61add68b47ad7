"""Computes where the objects on a written network's roads cut its edges, and which roads meet at each roundabout."""
