"""A test case's network as an OpenDRIVE map: the map it came from, or what netconvert makes of its net."""

from __future__ import annotations

import re
import tempfile
from pathlib import Path

from foresee_dsl.compile.nets.netconvert import run_netconvert, without_header
from foresee_dsl.errors import CompileError
from foresee_dsl.exchange.outcome import ExchangeError
from foresee_dsl.language.model import Network

_DATE = re.compile(rb'(<header\b[^>]*?) date="[^"]*"')
_OPTIONS = ("--precision", "4", "--no-warnings", "true")


def opendrive_of(network: Network | Path, net_file: Path) -> bytes:
    """Return an OpenDRIVE map in the net's own coordinates; the same net gives the same bytes.

    An imported map is given back as it is.

    Args:
        network: the test case's. net_file: the net compiled from it.

    Raises:
        ExchangeError: netconvert cannot write it, or the imported map cannot be read.
    """
    if isinstance(network, Path) and network.name.endswith(".xodr"):
        try:
            return network.read_bytes()
        except OSError as err:
            raise ExchangeError(f"{network} cannot be read: {err.strerror or err}") from err
    with tempfile.TemporaryDirectory(prefix="foresee-xodr-") as name:
        folder = Path(name)
        try:
            run_netconvert(["-s", str(net_file), "--opendrive-output", "map.xodr", *_OPTIONS], folder)
        except CompileError as err:
            raise ExchangeError(f"the network cannot be written as OpenDRIVE: {err}") from err
        return _DATE.sub(rb"\1", without_header((folder / "map.xodr").read_bytes()), count=1)
