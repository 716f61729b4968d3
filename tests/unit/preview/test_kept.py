"""What is kept, and for how long."""

from __future__ import annotations

from motion_transfer.preview.kept import Kept


def test_what_was_used_longest_ago_makes_room() -> None:
    kept = Kept[bytes](10, len)
    kept.put("a", b"1234")
    kept.put("b", b"1234")
    assert kept.get("a") == b"1234"
    kept.put("c", b"1234")
    assert (kept.get("a"), kept.get("b"), kept.get("c")) == (b"1234", None, b"1234")


def test_a_name_put_again_counts_once() -> None:
    kept = Kept[bytes](10, len)
    for _ in range(5):
        kept.put("a", b"123456")
    kept.put("b", b"1234")
    assert kept.get("a") is not None


def test_what_is_larger_than_the_room_is_not_kept() -> None:
    kept = Kept[bytes](3, len)
    kept.put("a", b"1234")
    assert kept.get("a") is None
