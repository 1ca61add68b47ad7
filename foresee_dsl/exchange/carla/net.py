"""Prepares a SUMO net of a town: CARLA's coordinates, sidewalks and crossings."""

from __future__ import annotations

import tempfile
from pathlib import Path

from foresee_dsl.compile.foreign.lane_overlaps import repair_overlaps
from foresee_dsl.compile.foreign.networks import close_parking, write_net
from foresee_dsl.compile.foreign.signal_programs import fix_times, give_programs
from foresee_dsl.compile.nets.netconvert import run_netconvert
from foresee_dsl.compile.nets.safe_xml import parse_net
from foresee_dsl.exchange.outcome import ExchangeError

SIDEWALK_MOST_MPS = 30.0
"""Roads up to this limit get sidewalks (ours: all of CARLA's towns but for the motorways of Town04 and 05)."""


def prepared_net(source: Path, out: Path) -> None:
    """Write a net in the coordinates of the map that it was made of, with sidewalks and crossings if it has none.

    Programs of signals are replaced by ours: those of a net that was made of CARLA's map are netconvert's guesses.

    Raises:
        CompileError: it is no net, or netconvert refuses it.
        ExchangeError: its offset is no number.
    """
    root = parse_net(source)
    location = root.find("location")
    try:
        x, y = (
            float(part) for part in (location.get("netOffset", "0,0") if location is not None else "0,0").split(",")
        )
    except ValueError as err:
        raise ExchangeError(f"{source} has a netOffset that is no pair of numbers") from err
    walks = any(lane.get("allow") == "pedestrian" for lane in root.iter("lane"))
    options = ["--offset.disable-normalization", "true", "--offset.x", f"{-x}", "--offset.y", f"{-y}"]
    if not walks:
        options += ["--sidewalks.guess", "true", "--sidewalks.guess.max-speed", f"{SIDEWALK_MOST_MPS}"]
    options += ["--crossings.guess", "true", "--no-turnarounds.except-deadend", "true", "--no-warnings", "true"]
    with tempfile.TemporaryDirectory(prefix="foresee-net-") as name:
        folder = Path(name)
        run_netconvert(["-s", str(source.resolve()), *options, "-o", "net.net.xml"], folder)
        net = parse_net(folder / "net.net.xml")
        close_parking(net)
        repair_overlaps(net)
        give_programs(net)
        fix_times(net)  # of joint signals, which keep theirs
        write_net(net, out)
