"""foresee-dsl for planners that are written against other interfaces; each bridge is a package of this one.

A bridge imports the library that it is for only when it is used.
"""
