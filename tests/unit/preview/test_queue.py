"""What is drawn when, and what is kept for how long."""

from __future__ import annotations

import threading
from collections.abc import Iterator

import pytest

from motion_transfer.preview.queue import ByteCache, DrawQueue


@pytest.fixture
def queue() -> Iterator[DrawQueue]:
    made = DrawQueue()
    yield made
    made.close()


def busy(queue: DrawQueue) -> threading.Event:
    """Keep the queue busy until the event is set, so that others wait."""
    begun, go_on = threading.Event(), threading.Event()
    queue.ask(lambda: begun.set() or go_on.wait(10))
    assert begun.wait(10)
    return go_on


def test_the_nearest_to_what_was_asked_for_last_comes_first(queue: DrawQueue) -> None:
    go_on, drawn = busy(queue), []
    futures = [queue.ask(lambda i=i: drawn.append(i), place=i) for i in (3, 40, 9, 12, 10)]
    go_on.set()
    for future in futures:
        future.result(10)
    assert drawn == [10, 9, 12, 3, 40]


def test_drafts_come_before_whole_pictures_and_the_source_before_both(queue: DrawQueue) -> None:
    go_on, drawn = busy(queue), []
    futures = [
        queue.ask(lambda: drawn.append("whole"), place=5),
        queue.ask(lambda: drawn.append("draft"), place=90, draft=True),
        queue.ask(lambda: drawn.append("near"), place=6),
        queue.ask(lambda: drawn.append("source")),
    ]
    go_on.set()
    for future in futures:
        future.result(10)
    assert drawn == ["source", "draft", "near", "whole"]


def test_what_is_cancelled_is_never_drawn(queue: DrawQueue) -> None:
    go_on, drawn = busy(queue), []
    gone, wanted = (queue.ask(lambda i=i: drawn.append(i), place=i) for i in (1, 2))
    assert gone.cancel()
    go_on.set()
    wanted.result(10)
    assert drawn == [2]


def test_an_error_reaches_whoever_asked_and_the_next_is_drawn(queue: DrawQueue) -> None:
    broken = queue.ask(lambda: 1 / 0, place=0)
    with pytest.raises(ZeroDivisionError):
        broken.result(10)
    assert queue.ask(lambda: "next", place=1).result(10) == "next"


def test_closing_cancels_what_waits() -> None:
    queue = DrawQueue()
    go_on = busy(queue)
    waiting = queue.ask(lambda: None, place=1)
    threading.Timer(0.05, go_on.set).start()
    queue.close()
    assert waiting.cancelled()
    assert queue.ask(lambda: None).cancelled()


def test_what_was_used_longest_ago_makes_room() -> None:
    kept = ByteCache[bytes](10, len)
    kept.put("a", b"1234")
    kept.put("b", b"1234")
    assert kept.get("a") == b"1234"
    kept.put("c", b"1234")
    assert (kept.get("a"), kept.get("b"), kept.get("c")) == (b"1234", None, b"1234")


def test_a_name_put_again_counts_once() -> None:
    kept = ByteCache[bytes](10, len)
    for _ in range(5):
        kept.put("a", b"123456")
    kept.put("b", b"1234")
    assert kept.get("a") is not None


def test_what_is_larger_than_the_room_is_not_kept() -> None:
    kept = ByteCache[bytes](3, len)
    kept.put("a", b"1234")
    assert kept.get("a") is None
