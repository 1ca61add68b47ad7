"""One job in a process of its own, with limits of time and memory: what it returns, or why it did not."""

from __future__ import annotations

import dataclasses
import multiprocessing
import resource
import time
import traceback
from collections.abc import Callable
from multiprocessing.connection import Connection

from corpus.rows import Outcome, Row


def run_limited(job: Callable[[], Row], name: str, seconds: float, megabytes: int) -> Row:
    """Return the job's row; one that says so where it raised, took too long or too much memory.

    The process is a fork of this one, so that imports are done once.
    """
    context = multiprocessing.get_context("fork")
    receiving, sending = context.Pipe(duplex=False)
    process = context.Process(target=_work, args=(job, name, megabytes, sending))
    begin = time.monotonic()
    process.start()
    sending.close()
    row = Row(name, Outcome.broken, f"no answer within {seconds:g} s")
    if receiving.poll(seconds):
        try:
            row = receiving.recv()
        except EOFError:
            row = Row(name, Outcome.broken, "its process died")
    process.join(1.0)
    if process.is_alive():
        process.kill()
        process.join()
    return dataclasses.replace(row, seconds=round(time.monotonic() - begin, 2))


def _work(job: Callable[[], Row], name: str, megabytes: int, answer: Connection) -> None:
    resource.setrlimit(resource.RLIMIT_AS, (megabytes * 2**20, megabytes * 2**20))
    try:
        row = job()
    except BaseException:
        row = Row(name, Outcome.broken, traceback.format_exc()[-800:])
    answer.send(row)
