"""Ends a driver that hangs: a signal handler interrupts an endless loop in Python; a call that stays in a library is
ended with its process.

A timer's signal checks regularly whether the driver is still in the same call. Python delivers signals to the main
thread only, so drivers in other threads are not watched. A debugger that traces the run switches the watch off.
"""

from __future__ import annotations

import faulthandler
import resource
import signal
import sys
import threading
import time
from types import FrameType
from typing import Self

from foresee_dsl import measuring
from foresee_dsl.drivers.deadlines import RESET_VARIABLE, Deadlines
from foresee_dsl.simulate.driver_faults import DriverHangs
from foresee_dsl.simulate.printed import printed_here
from foresee_dsl.simulate.results.verdict import Hang

_TICK_S = 1.0
"""Time between two checks, s. Ours: a tenth of a step's deadline; a check takes a few microseconds."""
_GRACE_S = 2.0
"""Time after the deadline for which the process may stay in a library's call before it is ended, s. Ours: two
checks."""


class DriverCall:
    """The current call of the driver: `with watch.call("step"): ...`.

    Attributes:
        name: `reset`, `step` or `close`; empty between two calls. number: the number of calls so far: 1 in the reset, 2
            in the first step.
    """

    def __init__(self) -> None:
        self.name = self._next = ""
        self.number = 0

    def __call__(self, name: str) -> Self:
        """Name the call of the driver that begins, such as `step`."""
        self._next = name
        return self

    def __enter__(self) -> None:
        """Begin the call, and store its starting time."""
        self.number += 1
        self.name = self._next
        if (clock := measuring.clock()) is not None:
            clock.begin_decision(first=self.name != "step" or self.number == 2)

    def __exit__(self, *_: object) -> None:
        """End the call, because the driver has answered or raised an exception."""
        self.name = ""
        if (clock := measuring.clock()) is not None:
            clock.end()


class DriverWatch:
    """Watches the driver of one run.

    Attributes:
        call: the driver's current call.
    """

    def __init__(self, deadlines: Deadlines | None, simulated_s: float) -> None:
        """Prepare the watch; without deadlines it does nothing. `simulated_s`: longest simulated time of the run."""
        self.call = DriverCall()
        self._limits = None
        if deadlines is not None and threading.current_thread() is threading.main_thread():
            steps_s = deadlines.for_reset_s, deadlines.for_first_step_s, deadlines.for_step_s
            self._limits = (*steps_s, deadlines.for_run_s(simulated_s))
        self._began_s = self._since_s = time.monotonic()
        self._seen = 0
        self._programs_ns = 0
        self._raised = False

    def __enter__(self) -> Self:
        """Start the timer."""
        self._programs_ns = _programs_ns()
        if self._limits is not None:
            tick_s = min(_TICK_S, *(limit / 4 for limit in self._limits))
            self._before = signal.signal(signal.SIGALRM, self._look)
            signal.setitimer(signal.ITIMER_REAL, tick_s, tick_s)
        return self

    def __exit__(self, *_: object) -> None:
        """Stop the timer and restore the signal handler."""
        if (clock := measuring.clock()) is not None:
            # An external driver's program has ended before this point.
            clock.add_programs(_programs_ns() - self._programs_ns)
        if self._limits is not None:
            signal.setitimer(signal.ITIMER_REAL, 0)
            signal.signal(signal.SIGALRM, self._before)
            if printed_here() is not None:
                faulthandler.cancel_dump_traceback_later()

    def starts(self) -> None:
        """Set the deadline of the first step.

        The driver was reset just before, and many steps may follow before the next check.
        """
        files = printed_here()
        if self._limits is not None and files is not None:
            files.end_after(self._limits[1] + _GRACE_S)

    def _look(self, _number: int, _frame: FrameType | None) -> None:
        if self._limits is None or sys.gettrace() is not None:
            return
        now_s = time.monotonic()
        reset_s, first_s, step_s, run_s = self._limits
        call = self.call
        if call.number != self._seen:
            self._seen, self._since_s = call.number, now_s
        limit_s = reset_s if call.number < 2 else first_s if call.number == 2 else step_s
        files = printed_here()
        if files is not None:
            files.trim()
            if not self._raised:  # after the exception, the exceeded deadline is kept
                files.end_after(min(limit_s, max(0.0, self._began_s + run_s - now_s)) + _GRACE_S)
        if not call.name:
            return
        if now_s - self._began_s >= run_s:
            self._raised = True
            raise DriverHangs(f"the run took longer than {run_s:g} s of wall time", "--deadline", Hang("run", run_s))
        if now_s - self._since_s >= limit_s:
            self._raised = True
            reset = call.name == "reset"
            what = f"step {call.number - 1}" if call.name == "step" else f"its {call.name}"
            raise DriverHangs(
                f"the driver took longer than {limit_s:g} s of wall time for {what}",
                RESET_VARIABLE if reset else "--step-deadline",
                Hang("reset" if reset else "step", limit_s),
            )


def _programs_ns() -> int:
    """Return the CPU time of the programs that this process has started and that have ended, ns."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return round((used.ru_utime + used.ru_stime) * 1e9)
