"""The queue of waiting tasks: the most urgent first, and among equally urgent ones those that a process is warm for.

Priorities are tuples, smaller ones first. Their last number is only a preference: tasks whose priorities differ in it
alone are equally urgent.
"""

from __future__ import annotations

import heapq
from collections import Counter
from collections.abc import Sequence
from itertools import count

Priority = tuple[int, ...]
Shares = tuple[str, ...]
"""Inputs of a task, from those that many tasks share to those that few share: a network, a test case, a clip."""


class TaskQueue:
    """Waiting tasks by number."""

    def __init__(self) -> None:
        self._waiting: dict[int, tuple[Priority, int, Shares]] = {}
        self._heaps: dict[Shares, list[tuple[Priority, int, int]]] = {}
        """Priority, turn and number of tasks by shared inputs (`()`: all tasks); may contain tasks already removed."""
        self._sharing: Counter[Shares] = Counter()
        """Number of waiting tasks by shared inputs."""
        self._turns = count()

    def __len__(self) -> int:
        return len(self._waiting)

    def push(self, number: int, priority: Priority, shares: Shares = ()) -> None:
        """Queue a task, after those of the same priority."""
        turn = next(self._turns)
        self._waiting[number] = priority, turn, shares
        for length in range(len(shares) + 1):
            heapq.heappush(self._heaps.setdefault(shares[:length], []), (priority, turn, number))
            self._sharing[shares[:length]] += 1

    @property
    def first(self) -> int:
        """The most urgent task, which remains queued; `IndexError` if there is none."""
        return self._head()[1]

    def take(self, most: int = 1, warm: Sequence[Shares] = ()) -> list[int]:
        """Remove and return one of the most urgent tasks, and up to `most` in all that are as urgent and share its
        inputs.

        `warm`: inputs that a process has used, the latest first; tasks that share most with one of them are preferred.

        Raises:
            IndexError: there is none.
        """
        priority, number = self._head()
        urgency = priority[:-1]
        number = self._warm(warm, urgency, number)
        shares = self._waiting[number][2]
        numbers: list[int] = []
        while True:
            numbers.append(number)
            self._remove(number)
            top = self._top(shares)
            if len(numbers) == most or top is None or top[0][:-1] != urgency or self._waiting[top[1]][2] != shares:
                return numbers
            number = top[1]

    def clear(self) -> None:
        """Remove all tasks."""
        self._waiting.clear()
        self._heaps.clear()
        self._sharing.clear()

    def _head(self) -> tuple[Priority, int]:
        head = self._top(())
        if head is None:
            raise IndexError("no task is waiting")
        return head

    def _warm(self, warm: Sequence[Shares], urgency: Priority, otherwise: int) -> int:
        for length in range(max(map(len, warm), default=0), 0, -1):
            for shares in warm:
                top = self._top(shares[:length]) if len(shares) >= length else None
                if top is not None and top[0][:-1] == urgency:
                    return top[1]
        return otherwise

    def _remove(self, number: int) -> None:
        _, _, shares = self._waiting.pop(number)
        for length in range(len(shares) + 1):
            self._sharing[shares[:length]] -= 1
            if not self._sharing[shares[:length]]:
                del self._sharing[shares[:length]], self._heaps[shares[:length]]

    def _top(self, shares: Shares) -> tuple[Priority, int] | None:
        """Return priority and number of the most urgent task with these inputs; None if there is none."""
        heap = self._heaps.get(shares)
        while heap:
            priority, turn, number = heap[0]
            entry = self._waiting.get(number)
            if entry is not None and entry[1] == turn:
                return priority, number
            heapq.heappop(heap)
        return None
