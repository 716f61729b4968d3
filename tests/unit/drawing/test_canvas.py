"""People laid over backgrounds: colours at their edges, transparency, depth, shadows."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from motion_transfer.drawing.canvas import (
    Canvas,
    Figure,
    Spot,
    lay_over,
    paste,
    show_alpha,
)
from motion_transfer.drawing.light import Light, cast_shadow, match_light, measure_light, relight
from motion_transfer.drawing.window import Window

COLOUR = (200, 30, 90)
UNDER = (255, 255, 255), (0, 0, 0), (0, 255, 0)
NOTHING = np.zeros((1, 1, 3), np.uint8)


def disc(side: int = 64, *, nobody: tuple[int, int, int] = (255, 255, 255)) -> np.ndarray:
    """Somebody of one colour with a soft edge; where nobody is, any colour may stand."""
    coverage = np.zeros((side, side), np.uint8)
    cv2.circle(coverage, (side // 2, side // 2), side // 3, 255, -1)
    coverage = cv2.GaussianBlur(coverage, (0, 0), side / 30)
    rgba = np.full((side, side, 4), (*COLOUR, 0), np.uint8)
    rgba[..., 3] = coverage
    rgba[coverage == 0, :3] = nobody
    return rgba


def over(rgba: np.ndarray, under: tuple[int, int, int]) -> np.ndarray:
    share = rgba[..., 3:].astype(float) / 255
    return rgba[..., :3] * share + np.array(under) * (1 - share)


@pytest.mark.parametrize("side", [64, 100, 40, 23, 127])
@pytest.mark.parametrize("nobody", [(255, 255, 255), (0, 255, 0)])
def test_a_scaled_edge_holds_the_persons_colour_alone(
    side: int, nobody: tuple[int, int, int]
) -> None:
    frame = np.zeros((side, side, 4), np.uint8)
    paste(frame, disc(nobody=nobody), Window(0, 0, side))
    truth = np.empty_like(frame)
    truth[...] = (*COLOUR, 0)
    truth[..., 3] = frame[..., 3]
    edge = (frame[..., 3] > 0) & (frame[..., 3] < 255)
    assert edge.sum() > side / 2
    for under in UNDER:
        assert np.abs(over(frame, under) - over(truth, under))[edge].max() <= 3
        drawn = np.full((side, side, 3), under, np.uint8)
        paste(drawn, disc(nobody=nobody), Window(0, 0, side))
        assert np.abs(drawn - over(truth, under))[edge].max() <= 3


@pytest.mark.parametrize(("scale", "most_px"), [(1.5, 0.1), (2, 0.25), (3, 0.2)])
def test_an_outline_that_is_enlarged_has_no_steps(scale: float, most_px: float) -> None:
    """An edge that moves one pixel every second row is a line then, where it was."""
    rows, columns = np.indices((64, 64))
    rgba = np.full((64, 64, 4), (*COLOUR, 255), np.uint8)
    rgba[..., 3] *= columns < 20 + rows // 2
    side = round(64 * scale)
    frame = np.zeros((side, side, 4), np.uint8)
    paste(frame, rgba, Window(0, 0, side))
    inner = np.arange(round(8 * scale), round(56 * scale))  # the picture's own border is no outline
    covered = frame[inner, :, 3]
    line = scale * 19.5 + (inner + 0.5) / 2
    away = covered.sum(1) / 255 - line
    assert np.abs(away).max() < most_px  # only enlarged: 0.36, 0.37 and 0.75
    soft = ((covered > 25) & (covered < 230)).sum(1)
    assert soft.max() <= np.ceil(scale), "it stays as sharp"


@pytest.mark.parametrize("side", [40, 64, 100, 192])
@pytest.mark.parametrize("share", [0.5, 0.61])
def test_who_is_cut_off_by_the_border_is_solid_up_to_it(side: int, share: float) -> None:
    """A driver's frame ends in the middle of somebody: there is nothing in the crop beyond it."""
    height, width = round(share * side), round(0.9 * side)
    window = Window(0, 0, side)
    rgba = np.full((64, 64, 4), (*COLOUR, 255), np.uint8)
    beyond = np.arange(64) + 0.5 > height * 64 / side  # as the frame is cut to the window
    rgba[beyond, :, 3] = 0
    frame = np.zeros((height, width, 3), np.uint8)
    paste(frame, rgba, window)
    assert (frame == COLOUR).all()
    moved = np.zeros((height, width, 3), np.uint8)
    paste(moved, rgba[::-1, ::-1], Window(width - side, height - side, side))
    assert (moved == COLOUR).all()


@pytest.mark.parametrize(("x", "y"), [(-40, 3), (3, -70), (50, 60), (200, 0), (-64, -64)])
def test_what_reaches_beyond_the_frame_is_cut(x: int, y: int) -> None:
    frame, whole = np.zeros((70, 60, 3), np.uint8), np.zeros((400, 400, 3), np.uint8)
    lay_over(frame, disc(), x, y)
    lay_over(whole, disc(), 150 + x, 150 + y)
    assert (frame == whole[150:220, 150:210]).all()


def test_two_layers_are_the_same_over_a_background_and_with_alpha() -> None:
    first, second = disc(), disc(nobody=(0, 0, 0))
    second[..., :3] = (20, 200, 250)
    layers = np.zeros((80, 80, 4), np.uint8)
    lay_over(layers, first, 0, 0)
    lay_over(layers, second, 16, 16)
    for under in UNDER:
        frame = np.full((80, 80, 3), under, np.uint8)
        lay_over(frame, first, 0, 0)
        lay_over(frame, second, 16, 16)
        assert np.abs(over(layers, under) - frame).max() <= 2


def test_who_stands_lower_is_nearer() -> None:
    canvas = Canvas(64, 64)
    near, far = disc(), disc()
    far[..., :3] = (0, 0, 250)
    figures = [Figure(near, Spot(Window(0, 0, 64), 60)), Figure(far, Spot(Window(8, 0, 64), 50))]
    black = np.zeros((64, 64, 3), np.uint8)
    frames = [canvas.lay_out(black, order, NOTHING) for order in (figures, figures[::-1])]
    assert (frames[0] == frames[1]).all()
    assert tuple(frames[0][32, 36]) == COLOUR
    assert not black.any()


def test_nothing_behind_gives_alpha() -> None:
    frame = Canvas(64, 64, transparent=True).lay_out(
        None, [Figure(disc(), Spot(Window(0, 0, 64), 60))], NOTHING
    )
    assert frame.shape == (64, 64, 4)
    assert (frame[..., 3] == disc()[..., 3]).all()
    assert not frame[frame[..., 3] == 0].any()
    board = show_alpha(frame)
    assert set(np.unique(board[:8, :8])) <= {204, 255}
    assert tuple(board[32, 32]) == COLOUR


def test_a_shadow_lies_at_the_feet_and_fades_in_a_jump() -> None:
    person = np.zeros((200, 200), np.uint8)
    person[40:160, 90:110] = 255
    standing, jumping = cast_shadow(person, 0.8), cast_shadow(person, 0.95)
    assert standing is not None and jumping is not None
    height, width = standing.shape
    assert width == 2 * height
    row, column = np.unravel_index(standing.argmax(), standing.shape)
    assert row / height == pytest.approx(0.8, abs=0.03)
    assert column / width == pytest.approx(0.5, abs=0.03)  # half a window farther left
    assert 80 < standing.max() < 150
    assert jumping.max() < standing.max() * 0.7
    assert not standing[: height // 2].any()
    assert cast_shadow(np.zeros((50, 50), np.uint8), 0.9) is None


def test_a_shadow_is_black_and_transparent_where_nothing_is_behind() -> None:
    figure = Figure(disc(), Spot(Window(0, 0, 64), 54))
    frame = Canvas(64, 64, transparent=True, shadows=True).lay_out(None, [figure], NOTHING)
    shade = (frame[..., 3] > 0) & (disc()[..., 3] == 0)
    assert shade.sum() > 20
    assert not frame[shade][:, :3].any()
    white = np.full((64, 64, 3), 255, np.uint8)
    drawn = Canvas(64, 64, shadows=True).lay_out(white, [figure], NOTHING)
    assert np.abs(drawn - over(frame, (255, 255, 255))).max() <= 2


def test_light_goes_half_way() -> None:
    random = np.random.default_rng(0)
    dark = random.integers(20, 80, (64, 64, 3), np.uint8)
    light = random.integers(90, 250, (64, 64, 3), np.uint8)
    own, around = measure_light(dark), measure_light(light)
    lit = relight(np.dstack([dark, np.full((64, 64), 255, np.uint8)]), match_light(own, around))
    found = measure_light(np.ascontiguousarray(lit[..., :3]))
    assert found.mean[0] == pytest.approx((own.mean[0] + around.mean[0]) / 2, abs=2)
    assert own.deviation[0] < found.deviation[0] < around.deviation[0]
    assert (lit[..., 3] == 255).all()


def test_the_same_light_changes_nothing() -> None:
    same = Light((120, 130, 125), (30, 5, 5))
    table = match_light(same, same)
    assert (table[0] == np.arange(256)[:, None]).all()


def test_light_is_measured_where_somebody_is() -> None:
    picture = np.zeros((20, 20, 3), np.uint8)
    picture[5:10, 5:10] = 255
    where = (picture[..., 0] > 0).astype(np.uint8)
    assert measure_light(picture, where).mean[0] == pytest.approx(255)
    assert measure_light(picture, where).deviation[0] == pytest.approx(0, abs=0.1)
