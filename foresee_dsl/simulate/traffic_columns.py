"""Columns of the tables that `traffic_kernels` works on."""

HALF, AXLE, WHEELBASE, STEER_MOST, LINE = range(5)
"""Columns of `shape`, m and rad: half its length; from the front bumper to the rear axle; wheelbase; largest angle of
the front wheels; how far to the left of its lane's middle it keeps."""
FRONT_X, FRONT_Y, RAW_X, RAW_Y, OFFSET, BESIDE_S, BENDS_S = range(7)
"""Columns of `memory`, m: its front; where SUMO has that; how far to the left of SUMO's it is drawn; how far along its
lane it was, the first for its heading, the second for its bends (NaN: not looked up yet)."""
