from __future__ import annotations

import pytest

from nhrr_core import ALL_PARTS, PART_COUNT, PART_GROUPS, PART_NAMES
from nhrr_core.parts import FOREARMS


def test_every_part_has_a_name_of_its_own() -> None:
    assert len(PART_NAMES) == PART_COUNT + 1 == len(set(PART_NAMES)) == 25
    assert PART_NAMES[0] == "background"


@pytest.mark.parametrize(
    ("part", "name"),
    [
        (1, "torso-back"),
        (2, "torso-front"),
        (3, "hand-right"),
        (4, "hand-left"),
        (5, "foot-left"),
        (6, "foot-right"),
        (15, "upper-arm-left-front"),
        (23, "head-right"),
        (24, "head-left"),
    ],
)
def test_part_is_densepose_s(part: int, name: str) -> None:
    assert PART_NAMES[part] == name


def test_groups_share_out_all_parts() -> None:
    parts = [part for group in PART_GROUPS.values() for part in group]
    assert sorted(parts) == list(ALL_PARTS) == list(range(1, PART_COUNT + 1))


def test_groups_hold_what_they_are_called() -> None:
    for group, parts in PART_GROUPS.items():
        for part in parts:
            assert PART_NAMES[part].startswith(group.replace("feet", "foot").rstrip("s"))


def test_each_hand_has_the_forearm_of_its_side() -> None:
    assert set(FOREARMS) == set(PART_GROUPS["hands"])
    for hand, forearm in FOREARMS.items():
        side = PART_NAMES[hand].removeprefix("hand-")
        assert {PART_NAMES[part] for part in forearm} == {
            f"lower-arm-{side}-{face}" for face in ("inner", "outer")
        }
