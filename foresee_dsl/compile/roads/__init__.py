"""The road network as geometry: lines, lanes, routes, junctions, and the footways of pedestrians."""
