"""The faults of DensePose's own estimates, put on clean IUV.

DensePose looks at a person's box through a coarse grid, so hands become mittens and borders turn
round; its borders wander, its U and V drift, it loses hands and feet, and it takes left for right
and front for back. Clothes and hair are no matter here: neither clean IUV nor DensePose shows them.

Convention: as everywhere, IUV is uint8, H x W x 3, (I, U, V), background (0, 0, 0). One person is
in the picture. Lengths are in px of a person whose box has a longer side of 256 px; they scale with
that side, as DensePose scales each box to one size.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import cv2
import numpy as np
from jaxtyping import UInt8
from scipy.ndimage import find_objects

from motion_transfer.people.picture.paint import smooth_noise
from nhrr_core.parts import FOREARMS

Iuv = UInt8[np.ndarray, "H W 3"]
Parts = UInt8[np.ndarray, "H W"]
Rng = np.random.Generator

ARMS = ((3, 4), (19, 20), (21, 22), (15, 16), (17, 18))
LEGS = ((5, 6), (11, 12), (13, 14), (7, 8), (9, 10))
HEAD = ((23, 24),)
"""Parts and their twins on the other side of the body; the outer ones come first."""
LOWER_LIMB_PAIRS = 3
"""So many of them lie beyond elbow or knee."""

FACES = ((1, 2), (7, 9), (8, 10), (11, 13), (12, 14), (15, 17), (16, 18), (19, 21), (20, 22))
"""The two faces of the torso and of each limb."""
FEET = (5, 6)

# where the twin's chart runs the other way; measured on the charts through `nhrr_core.UVLayout`
U_TURNS_ACROSS_SIDES = (3, 4, 5, 6, 23, 24)
U_TURNS_ACROSS_FACES = (7, 8, 9, 10, 11, 12, 13, 14)
V_TURNS_ACROSS_FACES = (7, 8, 9, 10)

PERSON_PX = 256
# chosen by eye against real outputs
SILHOUETTE_WAVE_PX = 22.0  # how far along the border its movements are alike
PART_WAVE_PX = 18.0
DRIFT_WAVE_SHARE = 0.2  # of the person's box: U and V drift together over so much of it
PATCH_SHARE = 0.3  # of the box: a confusion of faces covers a patch about so large
REACH_PX = 7.0  # borders move less than this
SEVERITY = (0.5, 1.5)
CELL_BLUR = 1.73
"""Taking the mean over each cell of a grid and interpolating between them blurs like a box of so
many cells."""


@dataclass(frozen=True)
class IuvNoise:
    """How often and how strongly DensePose errs. All zero: it does not.

    Amplitudes are standard deviations; each call multiplies all of them by one number between 0.5
    and 1.5, since some pictures are harder than others.

    Attributes:
        silhouette_px: Movement of the person's border.
        part_border_px: Movement of the borders between parts.
        grid_cells: Cells along each side of the person's box that the estimate is made in; 0 for as
            many as there are pixels.
        uv_drift: Smooth error of U and V within a part, chart units.
        uv_shift: Constant error of U and V in each part, chart units.
        hand_loss: Probability that a hand is missing, for each hand.
        forearm_loss: Probability that the forearm is missing where the hand is.
        foot_loss: Probability that a foot is missing, for each foot.
        side_swap: Probability that left and right are confused, for the arms, legs and head each.
        face_swap: Probability that front and back are confused somewhere on a limb or the torso,
            for each of them.
        holes: Mean number of small holes in a person.
    """

    silhouette_px: float = 0.0
    part_border_px: float = 0.0
    grid_cells: int = 0
    uv_drift: float = 0.0
    uv_shift: float = 0.0
    hand_loss: float = 0.0
    forearm_loss: float = 0.0
    foot_loss: float = 0.0
    side_swap: float = 0.0
    face_swap: float = 0.0
    holes: float = 0.0

    @classmethod
    def densepose(cls) -> IuvNoise:
        """Err as the estimates do that circulate with fashion photos.

        DensePose predicts 56 x 56 cells a box and doubles them by interpolation. The rest was
        judged by eye against real outputs.
        """
        return cls(
            silhouette_px=0.7,
            part_border_px=1.4,
            grid_cells=56,
            uv_drift=0.02,
            uv_shift=0.015,
            hand_loss=0.06,
            forearm_loss=0.25,
            foot_loss=0.05,
            side_swap=0.03,
            face_swap=0.04,
            holes=0.5,
        )


def add_iuv_noise(iuv: Iuv, noise: IuvNoise, rng: Rng) -> Iuv:
    """Put faults on a clean IUV.

    Returns: a new array; equal to the input where `noise` is all zero or nobody is seen.
    Raises: ValueError unless the input is uint8, H x W x 3, with parts up to 24.
    """
    if iuv.dtype != np.uint8 or iuv.ndim != 3 or iuv.shape[2] != 3:
        raise ValueError(f"an IUV is uint8, H x W x 3, not {iuv.dtype}, {iuv.shape}")
    out = iuv.copy()
    part = iuv[..., 0].copy()
    highest = int(part.max(initial=0))
    if highest > 24:
        raise ValueError(f"part {highest} found; parts are 1 to 24, 0 is background")
    if noise == IuvNoise() or highest == 0:
        return out
    x, y, width, height = cv2.boundingRect(part)
    scale = max(width, height) / PERSON_PX
    # work on the box alone, with room for the border to move by four deviations
    margin = 2 + round(4 * SEVERITY[1] * noise.silhouette_px * scale)
    rows = slice(max(0, y - margin), y + height + margin)
    columns = slice(max(0, x - margin), x + width + margin)
    severity = rng.uniform(*SEVERITY)
    person = out[rows, columns]
    person = lose_parts(person, noise.hand_loss, noise.forearm_loss, noise.foot_loss, rng)
    person = swap_sides(person, noise.side_swap, rng)
    person = swap_faces(person, noise.face_swap, rng)

    part = cv2.extractChannel(person, 0)
    if noise.grid_cells:
        part = _see_coarsely(part, noise.grid_cells, width, height)
    if noise.part_border_px:
        part = _ragged_part_borders(part, severity * noise.part_border_px * scale, scale, rng)
    grown = np.zeros(0, np.intp)
    if noise.silhouette_px:
        part, grown = _ragged_silhouette(part, severity * noise.silhouette_px * scale, scale, rng)
    person = _fill_parts(person, part, grown, max(3, round(REACH_PX * scale)))
    if noise.uv_drift or noise.uv_shift:
        _drift(person, severity * noise.uv_drift, severity * noise.uv_shift, rng)
    if noise.holes:
        _punch_holes(person, noise.holes, scale, rng)
    out[rows, columns] = person
    return out


def lose_parts(iuv: Iuv, hand: float, forearm: float, foot: float, rng: Rng) -> Iuv:
    """Turn hands, forearms and feet into background, each with its probability.

    Args:
        forearm: Counts only where the hand of that arm is lost.
    """
    draws = rng.random(6)  # always as many, so that one rate does not shift what others draw
    lost = [f for f, draw in zip(FEET, draws[:2], strict=True) if draw < foot]
    for (part, arm), draw, arm_draw in zip(FOREARMS.items(), draws[2:4], draws[4:], strict=True):
        if draw < hand:
            lost += [part, *arm] if arm_draw < forearm else [part]
    if not lost:
        return iuv
    keep = np.ones(256, np.uint8)
    keep[lost] = 0
    return iuv * keep[iuv[..., :1]]


def swap_sides(iuv: Iuv, probability: float, rng: Rng) -> Iuv:
    """Take left for right: on the arms, the legs and the head, each with that probability.

    A confused pair trades places, or both are taken for the same side; on limbs, the whole of them
    or what lies beyond elbow and knee.
    """
    becomes = np.arange(256, dtype=np.uint8)
    for pairs in (ARMS, LEGS, HEAD):
        chosen, lower, way = rng.random() < probability, rng.random() < 0.5, rng.integers(3)
        if not chosen:
            continue
        for first, second in pairs[:LOWER_LIMB_PAIRS] if lower else pairs:
            if way != 1:
                becomes[first] = second
            if way != 2:
                becomes[second] = first
    if (becomes == np.arange(256)).all():
        return iuv
    return _renamed(iuv, becomes[iuv[..., 0]], U_TURNS_ACROSS_SIDES, ())


def swap_faces(iuv: Iuv, probability: float, rng: Rng) -> Iuv:
    """Take front for back, in a patch of the torso or of a limb, each with that probability."""
    draws = rng.random(len(FACES))
    becomes = np.arange(256, dtype=np.uint8)
    for (first, second), draw in zip(FACES, draws, strict=True):
        if draw < probability:
            becomes[[first, second]] = second, first
    if not (draws < probability).any():
        return iuv
    patch = smooth_noise(iuv.shape, PATCH_SHARE * max(iuv.shape), rng) > rng.uniform(-0.5, 1)
    part = np.where(patch, becomes[iuv[..., 0]], iuv[..., 0])
    return _renamed(iuv, part, U_TURNS_ACROSS_FACES, V_TURNS_ACROSS_FACES)


def _renamed(iuv: Iuv, part: np.ndarray, u_turns: tuple[int, ...], v_turns: tuple[int, ...]) -> Iuv:
    """Give an IUV other parts; where one changes, U and V run back in the charts named."""
    out = iuv.copy()
    out[..., 0] = part
    places = np.flatnonzero(part != iuv[..., 0])
    before, after = iuv.reshape(-1, 3)[places], out.reshape(-1, 3)
    for channel, turning in ((1, u_turns), (2, v_turns)):
        turned = np.isin(before[:, 0], turning)
        after[places[turned], channel] = 255 - before[turned, channel]
    return out


def _see_coarsely(part: Parts, cells: int, width: int, height: int) -> Parts:
    """Find each pixel's likeliest part after the parts have passed through a grid of cells.

    Args:
        width, height: The person's box, which the grid is laid over.
    """
    kernel = tuple(1 + 2 * round(0.5 * (CELL_BLUR * side / cells - 1)) for side in (width, height))
    if max(kernel) <= 1:
        return part
    best = cv2.blur((part == 0) * np.uint8(255), kernel)
    winner = np.zeros(part.shape, np.uint8)
    reach = max(kernel) // 2  # a part counts no further from its own box
    for p, found in enumerate(find_objects(part, max_label=24), start=1):
        if found is None:
            continue
        box = tuple(slice(max(0, side.start - reach), side.stop + reach) for side in found)
        score = cv2.blur((part[box] == p) * np.uint8(255), kernel)
        better = cv2.compare(score, best[box], cv2.CMP_GT)
        cv2.copyTo(score, better, best[box])
        np.copyto(winner[box], np.uint8(p), where=better.view(bool))
    return winner


def _ragged_part_borders(part: Parts, amplitude_px: float, scale: float, rng: Rng) -> Parts:
    """Move the borders between parts; keep the silhouette."""
    height, width = part.shape
    wave = PART_WAVE_PX * scale
    x = np.arange(width, dtype=np.float32) + amplitude_px * smooth_noise(part.shape, wave, rng)
    y = amplitude_px * smooth_noise(part.shape, wave, rng)
    y += np.arange(height, dtype=np.float32)[:, None]
    moved = cv2.remap(part, x, y, cv2.INTER_NEAREST, borderMode=cv2.BORDER_REPLICATE)
    return cv2.copyTo(moved, cv2.min(part, moved), part.copy())  # where both are not 0


def _ragged_silhouette(
    part: Parts, amplitude_px: float, scale: float, rng: Rng
) -> tuple[Parts, np.ndarray]:
    """Move the silhouette's border.

    Returns: the parts left; and where the person has grown, as flat indices.
    """
    inside = (part > 0).astype(np.uint8)
    depth = cv2.distanceTransform(inside, cv2.DIST_L2, 3)
    depth -= cv2.distanceTransform(1 - inside, cv2.DIST_L2, 3)
    depth += np.float32(0.5) - inside  # the border runs between pixels
    wanted = depth > amplitude_px * smooth_noise(part.shape, SILHOUETTE_WAVE_PX * scale, rng)
    return part * wanted.view(np.uint8), np.flatnonzero(wanted & (part == 0))


def _fill_parts(iuv: Iuv, part: Parts, grown: np.ndarray, reach_px: int) -> Iuv:
    """Give an IUV new parts.

    A pixel that joins a part takes U and V of that part's nearest pixel; one that joins the person
    takes all of the nearest pixel of the person. Where none is within reach, nothing joins.
    """
    old = cv2.extractChannel(iuv, 0)
    joining = np.flatnonzero((part != old) & (part > 0))
    wanted = part.ravel()[joining]
    source = _nearest(old, joining, wanted, reach_px)
    out = np.zeros_like(iuv)
    cv2.copyTo(iuv, part, out)  # where part is not 0
    out = out.reshape(-1, 3)
    out[joining, 0] = wanted
    out[joining, 1:] = iuv.reshape(-1, 3)[source, 1:]
    out[joining[source < 0]] = 0
    source = _nearest((part > 0).view(np.uint8), grown, np.ones(len(grown), np.uint8), reach_px)
    out[grown[source >= 0]] = out[source[source >= 0]]
    return out.reshape(iuv.shape)


def _nearest(image: Parts, places: np.ndarray, wanted: np.ndarray, reach_px: int) -> np.ndarray:
    """Find where near some places (flat indices) an image has the values wanted there.

    Few places are asked for and most lie close by, so that looking around each in widening
    circles is faster than a distance transform for each part.

    Returns: flat indices, -1 where the value is not within reach.
    """
    padded = np.pad(image, reach_px)
    stride = padded.shape[1]
    rows, columns = np.divmod(places, image.shape[1])
    centre = (rows + reach_px) * stride + columns + reach_px
    found = np.full(len(places), -1)
    left = np.arange(len(places))
    flat = padded.ravel()
    for circles in _circles(reach_px):
        hit = flat[centre[left, None] + circles @ (stride, 1)] == wanted[left, None]
        nearest = hit.argmax(1)
        hits = hit[np.arange(len(left)), nearest]
        found[left[hits]] = places[left[hits]] + circles[nearest[hits]] @ (image.shape[1], 1)
        left = left[~hits]
    return found


@cache
def _circles(radius: int) -> tuple[np.ndarray, ...]:
    """List steps (down, right) within a radius, the shortest first, in batches that grow."""
    span = range(-radius, radius + 1)
    steps = [(y, x) for y in span for x in span if 0 < y * y + x * x <= radius * radius]
    steps.sort(key=lambda step: step[0] ** 2 + step[1] ** 2)
    return tuple(np.split(np.array(steps), [4, 20]))


def _drift(iuv: Iuv, drift: float, shift: float, rng: Rng) -> None:
    """Change U and V of a person in place, differently in each part."""
    part = cv2.extractChannel(iuv, 0)
    wave = DRIFT_WAVE_SHARE * max(part.shape)
    gain, constant = np.zeros((2, 2, 256), np.float32)
    gain[:, 1:25] = 255 * drift * rng.standard_normal((2, 24), np.float32)
    constant[:, 1:25] = 255 * shift * rng.standard_normal((2, 24), np.float32)
    for channel in (0, 1):
        error = cv2.multiply(cv2.LUT(part, gain[channel]), smooth_noise(part.shape, wave, rng))
        error += cv2.LUT(part, constant[channel])
        clean = cv2.extractChannel(iuv, channel + 1)
        changed = cv2.add(clean, error, dtype=cv2.CV_8U)  # rounds and saturates
        cv2.insertChannel(changed, iuv, channel + 1)


def _punch_holes(iuv: Iuv, count: float, scale: float, rng: Rng) -> None:
    """Punch small holes, in place."""
    person = np.flatnonzero(iuv[..., 0])
    if len(person) == 0:
        return
    for centre in rng.choice(person, rng.poisson(count)):
        y, x = divmod(int(centre), iuv.shape[1])
        axes = np.rint(rng.uniform(0.5, 2.5, 2) * scale).astype(int).tolist()
        cv2.ellipse(iuv, (x, y), axes, rng.uniform(0, 180), 0, 360, (0, 0, 0), cv2.FILLED)
