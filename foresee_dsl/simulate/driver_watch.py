"""Ends a driver that hangs: in an endless loop by a signal's handler, in a library that none reaches with its process.

The loop of a run pays two additions a step. A timer's signal looks from time to time whether the driver is still in the
same call. Only the main thread gets signals: elsewhere nothing is watched. A debugger that traces the run stops the
watch.
"""

from __future__ import annotations

import faulthandler
import signal
import sys
import threading
import time
from types import FrameType
from typing import Self

from foresee_dsl.drivers.deadlines import RESET_VARIABLE, Deadlines
from foresee_dsl.simulate.driver_faults import DriverHangs
from foresee_dsl.simulate.printed import printed_here
from foresee_dsl.simulate.results.verdict import Hang

_TICK_S = 1.0
"""Between two looks. Ours: a tenth of the deadline of a step; a look takes a few microseconds."""
_GRACE_S = 2.0
"""How much longer a process may take to come back from a library. Ours: two looks."""


class Watch:
    """Watches one run.

    Attributes:
        calls: counted up by the run before and after each call of the driver, so it is odd while the driver works: 1 in
            `reset`, 3 in the first step, 5 in the second.
    """

    def __init__(self, deadlines: Deadlines | None, simulated_s: float) -> None:
        """Watch nothing when there are no deadlines."""
        self.calls = 0
        self._limits = None
        if deadlines is not None and threading.current_thread() is threading.main_thread():
            steps_s = deadlines.for_reset_s, deadlines.for_first_step_s, deadlines.for_step_s
            self._limits = (*steps_s, deadlines.for_run_s(simulated_s))
        self._began_s = self._since_s = time.monotonic()
        self._seen = 0
        self._raised = False

    def __enter__(self) -> Self:
        """Begin."""
        if self._limits is not None:
            tick_s = min(_TICK_S, *(limit / 4 for limit in self._limits))
            self._before = signal.signal(signal.SIGALRM, self._look)
            signal.setitimer(signal.ITIMER_REAL, tick_s, tick_s)
        return self

    def __exit__(self, *_: object) -> None:
        """End, and put things back as they were."""
        if self._limits is not None:
            signal.setitimer(signal.ITIMER_REAL, 0)
            signal.signal(signal.SIGALRM, self._before)
            if printed_here() is not None:
                faulthandler.cancel_dump_traceback_later()

    def starts(self) -> None:
        """Note that the driver was reset: steps have another deadline, and many of them come before the next look."""
        files = printed_here()
        if self._limits is not None and files is not None:
            files.end_after(self._limits[1] + _GRACE_S)

    def _look(self, _number: int, _frame: FrameType | None) -> None:
        if self._limits is None or sys.gettrace() is not None:
            return
        now_s = time.monotonic()
        reset_s, first_s, step_s, run_s = self._limits
        if self.calls != self._seen:
            self._seen, self._since_s = self.calls, now_s
        limit_s = reset_s if self.calls < 3 else first_s if self.calls == 3 else step_s
        files = printed_here()
        if files is not None:
            files.trim()
            if not self._raised:  # once it was told to end, it has the grace that is left
                files.end_after(min(limit_s, max(0.0, self._began_s + run_s - now_s)) + _GRACE_S)
        if self.calls % 2 == 0:
            return
        if now_s - self._began_s >= run_s:
            self._raised = True
            raise DriverHangs(f"the run took longer than {run_s:g} s of wall time", "--deadline", Hang("run", run_s))
        if now_s - self._since_s >= limit_s:
            self._raised = True
            reset = self.calls < 3
            call = "its reset" if reset else f"step {(self.calls - 1) // 2}"
            raise DriverHangs(
                f"the driver took longer than {limit_s:g} s of wall time for {call}",
                RESET_VARIABLE if reset else "--step-deadline",
                Hang("reset" if reset else "step", limit_s),
            )
