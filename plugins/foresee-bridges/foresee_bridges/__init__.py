"""foresee-dsl for planners that are written against other interfaces; each bridge is a subpackage of this package.

A bridge imports the library that it is for only when it is used.
"""
