"""The formats of `foresee export`, as entry points name them.

This module is imported for every help text, so heavy imports are inside the functions.
"""

from __future__ import annotations

from foresee_dsl.exchange.outcome import Imported
from foresee_dsl.exchange.protocol import Tell
from foresee_recordings.exporting.options import RunOptions


def to_fcd(options: RunOptions, tell: Tell) -> Imported:
    """Write runs as SUMO's floating car data, each with its vehicle types.

    [dim]foresee export fcd scenarios/scenario7.foresee::r01 --out traces[/dim]
    """
    from foresee_recordings.exporting import fcd, runs

    return runs.export(options, tell, fcd.write, fcd.left_out)


def to_commonroad(options: RunOptions, tell: Tell) -> Imported:
    """Write runs as CommonRoad scenarios (XML, 2020a) with lanelets.

    [dim]foresee export commonroad scenarios/scenario7.foresee::r01 --out traces[/dim]
    """
    from foresee_recordings.exporting import commonroad, runs

    return runs.export(options, tell, commonroad.write, commonroad.left_out)


def to_levelx(options: RunOptions, tell: Tell) -> Imported:
    """Write runs as tables with the columns of inD: NN_tracks.csv, NN_tracksMeta.csv, NN_recordingMeta.csv.

    [dim]foresee export levelx scenarios/scenario7.foresee::r01 --out traces[/dim]
    """
    from foresee_recordings.exporting import levelx, runs

    return runs.export(options, tell, levelx.write, levelx.left_out)
