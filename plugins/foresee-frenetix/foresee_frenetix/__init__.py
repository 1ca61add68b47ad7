"""The bundled driver `frenetix`: a modular stack, as in industry, around the sampling planner of a third party.

It consists of perception (tracks), prediction, a behaviour layer with named states, the planner of the package
`frenetix` (licence LGPL-3.0, installed by a separate extra and used unchanged), and PID tracking. Between steps it
keeps its tracks, the plan, the integral of its speed controller and the colours of signals.
"""

from __future__ import annotations

from importlib.metadata import PackageNotFoundError
from importlib.metadata import version as package_version
from typing import TYPE_CHECKING

from foresee_dsl.drivers.bundled import BundledDriver, memory_of
from foresee_dsl.drivers.parts import DriverPart
from foresee_dsl.drivers.protocol import Mission, VehicleLimits
from foresee_dsl.errors import DriverUnavailableError
from foresee_dsl.plugins import not_installed

if TYPE_CHECKING:
    from foresee_frenetix.stack import Stack

MISSING = f"the driver frenetix needs the package frenetix 0.4.0 (LGPL-3.0), which is {not_installed('frenetix')}"


def _version() -> str:
    try:
        return f"1 (library {package_version('frenetix')})"
    except PackageNotFoundError:
        return "1"


class FrenetixDriver(BundledDriver["Stack"]):
    """Behaviour states, frenetix's sampled trajectories, PID tracking: the modular stack (package frenetix, LGPL).

    `seed` has no effect; the same observations after the same `reset` give the same answers.
    """

    name = "frenetix"
    version = _version()
    parts = tuple(DriverPart)

    def __init__(self) -> None:
        try:
            import frenetix as _  # noqa: F401  an early and clear message where it is not installed
        except ImportError as err:
            raise DriverUnavailableError(f"{MISSING} ({err})" if "No module" not in str(err) else MISSING) from err

    def begin(self, mission: Mission, vehicle: VehicleLimits) -> Stack:
        """Return the state at the beginning of a mission."""
        from foresee_frenetix.stack import Stack  # imported here: its library is imported only to drive

        return Stack(mission, vehicle, memory_of(*self._ideal))

    @property
    def stack(self) -> Stack:
        """Return the driver's state: the behaviour's state, the plan, and the number of steps without a
        feasible plan.
        """
        return self.state
