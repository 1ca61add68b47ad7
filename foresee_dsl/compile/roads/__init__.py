"""The road network as geometry: lines, lanes, routes, junctions, and where people walk."""
