"""Draws a scene from above: a test case at its beginning, or a network alone, as SVG, PNG and a live page."""
