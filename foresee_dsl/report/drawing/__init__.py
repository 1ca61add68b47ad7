"""Drawing: a scene is turned into shapes in metres once, and each back end draws the same shapes.

`ground` finds the areas and lines of a road network, `shapes` turns them and the bodies of actors into shapes with a
paint of `palette`. A `sheet` holds one or several maps of such shapes with texts around them (`labels` places the names
in a map). The back ends are `svg` (and PNG from the SVG), `shapes.as_data` (JSON for the canvas of a page) and
`characters` (terminal).
"""
