"""The order in which waiting tasks are handed out: by urgency; among equals to the process that is warm for them."""

from __future__ import annotations

import pytest

from foresee_dsl.campaign.workers.pool import TaskQueue

TOWN, VILLAGE = "town", "village"


def queue_of(*tasks: tuple[int, tuple[int, ...], tuple[str, ...]]) -> TaskQueue:
    queue = TaskQueue()
    for task in tasks:
        queue.push(*task)
    return queue


def all_of(queue: TaskQueue, *warm: tuple[str, ...]) -> list[int]:
    return [queue.take(warm=warm)[0] for _ in range(len(queue))]


def test_smaller_priorities_come_first_and_among_equals_those_that_came_first() -> None:
    queue = queue_of((1, (2,), ()), (2, (1,), ()), (3, (1,), ()), (4, (0,), ()))
    assert queue.first == 4
    assert all_of(queue) == [4, 2, 3, 1]
    with pytest.raises(IndexError):
        queue.take()


def test_a_process_goes_on_with_its_clip_then_its_case_then_its_network() -> None:
    queue = queue_of(
        (1, (1, 1), (VILLAGE, "yard", "yard_p1")),
        (2, (1, 1), (TOWN, "tee", "tee_p2")),
        (3, (1, 1), (TOWN, "stop", "stop_p1")),
        (4, (1, 2), (TOWN, "tee", "tee_p1")),
    )
    assert all_of(queue, (TOWN, "tee", "tee_p1")) == [4, 2, 3, 1]


def test_the_clip_that_it_had_last_comes_before_the_one_before() -> None:
    queue = queue_of((1, (1, 2), (TOWN, "tee", "tee_p1")), (2, (1, 2), (TOWN, "stop", "stop_p1")))
    assert all_of(queue, (TOWN, "stop", "stop_p1"), (TOWN, "tee", "tee_p1")) == [2, 1]


def test_nothing_that_is_warm_comes_before_what_is_more_urgent() -> None:
    queue = queue_of((1, (2, 1), (TOWN, "tee", "tee_p1")), (2, (1, 9), (VILLAGE, "yard", "yard_p1")))
    assert all_of(queue, (TOWN, "tee", "tee_p1")) == [2, 1]


def test_a_process_without_work_of_its_own_takes_what_others_are_warm_for_last() -> None:
    """A fresh clip comes before the children of one that another process has at hand: their turn is later."""
    queue = queue_of((1, (1, 2), (TOWN, "tee", "tee_p1")), (2, (1, 1), (TOWN, "stop", "stop_p1")))
    assert all_of(queue, (TOWN, "start", "start_p1")) == [2, 1]


def test_tasks_are_handed_out_together_where_they_share_a_clip_and_are_equally_urgent() -> None:
    one, other = (TOWN, "tee", "tee_p1"), (TOWN, "tee", "tee_p2")
    queue = queue_of((1, (1, 2), one), (2, (1, 2), other), (3, (1, 3), one), (4, (2, 2), one), (5, (1, 2), one))
    assert queue.take(2) == [1, 5]
    assert queue.take(8) == [2]
    assert queue.take(8) == [3]
    assert queue.take(8) == [4]
    assert len(queue) == 0


def test_tasks_that_share_nothing_are_handed_out_together() -> None:
    queue = queue_of((1, (), ()), (2, (), ()), (3, (), (TOWN,)), (4, (), ()))
    assert queue.take(8) == [1, 2]
    assert queue.take(8, [(TOWN,)]) == [3]
    assert queue.take(8) == [4]


def test_a_task_that_comes_back_is_not_taken_for_its_former_self() -> None:
    queue = queue_of((1, (5,), (TOWN,)), (2, (4,), (TOWN,)))
    assert queue.take() == [2]
    queue.push(2, (9, 0), (TOWN,))
    assert queue.take() == [1]
    assert queue.take() == [2]
