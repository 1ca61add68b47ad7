"""The picture of a scene: a test case at its beginning (or a network alone) from above, as SVG, PNG and a live page."""
