"""The faults of DensePose's own estimates, put on clean IUV.

DensePose looks at a person's box through a coarse grid, so hands become mittens and borders turn
round; its borders wander, its U and V drift, it loses hands and feet, and it takes left for right
and front for back. Clothes and hair are no matter here: neither clean IUV nor DensePose shows them.

Convention: as everywhere, IUV is uint8, H x W x 3, (I, U, V), background (0, 0, 0). One person is
in the picture. Lengths are in px of a person whose box has a longer side of 256 px; they scale with
that side, as DensePose scales each box to one size.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache

import cv2
import numpy as np
from jaxtyping import UInt8
from scipy.ndimage import find_objects

from motion_transfer.people.picture.iuv_faults import lose_parts, swap_faces, swap_sides
from motion_transfer.people.picture.smooth_noise import smooth_noise

Iuv = UInt8[np.ndarray, "H W 3"]
Parts = UInt8[np.ndarray, "H W"]
Box = tuple[slice, slice]

PERSON_PX = 256
SILHOUETTE_WAVE_PX = 22.0  # how far along the border its movements are alike
PART_WAVE_PX = 18.0
DRIFT_WAVE_SHARE = 0.2  # of the person's box: U and V drift together over so much of it
REACH_PX = 7.0  # borders move less than this
SEVERITY = (0.5, 1.5)


@dataclass(frozen=True)
class IuvNoise:
    """How often and how strongly DensePose errs. All zero: it does not.

    Amplitudes are standard deviations; each call multiplies all of them by one number between 0.5
    and 1.5, since some pictures are harder than others.

    Attributes:
        silhouette_px: movement of the person's border.
        part_border_px: movement of the borders between parts.
        grid_cells: cells along each side of the person's box that the estimate is made in; 0 for as
            many as there are pixels.
        uv_drift: smooth error of U and V within a part, chart units.
        uv_shift: constant error of U and V in each part, chart units.
        hand_loss: probability that a hand is missing, for each hand.
        forearm_loss: probability that the forearm is missing where the hand is.
        foot_loss: probability that a foot is missing, for each foot.
        side_swap: probability that left and right are confused, for the arms, legs and head each.
        face_swap: probability that front and back are confused somewhere on a limb or the torso,
            for each of them.
        holes: mean number of small holes in a person.
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
    def none(cls) -> IuvNoise:
        """No faults."""
        return cls()

    @classmethod
    def densepose(cls) -> IuvNoise:
        """As in the estimates that circulate with fashion photos.

        DensePose predicts 56 x 56 cells a box and doubles them by interpolation. The rest is
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


def add_iuv_noise(iuv: Iuv, noise: IuvNoise, rng: np.random.Generator) -> Iuv:
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


def _see_coarsely(part: Parts, cells: int, width: int, height: int) -> Parts:
    """Each pixel's likeliest part after the parts have passed through a grid of cells.

    Taking the mean over each cell and interpolating between cells blurs like a box of 1.73 cells.

    Args:
        width, height: of the person's box, which the grid is laid over.
    """
    kernel = tuple(1 + 2 * round(0.5 * (1.73 * side / cells - 1)) for side in (width, height))
    if max(kernel) <= 1:
        return part
    best = cv2.blur((part == 0) * np.uint8(255), kernel)
    winner = np.zeros(part.shape, np.uint8)
    for p, box in _boxes(part, reach=max(kernel) // 2):
        score = cv2.blur((part[box] == p) * np.uint8(255), kernel)
        better = cv2.compare(score, best[box], cv2.CMP_GT)
        cv2.copyTo(score, better, best[box])
        np.copyto(winner[box], np.uint8(p), where=better.view(bool))
    return winner


def _boxes(part: Parts, reach: int = 0) -> Iterator[tuple[int, Box]]:
    """Each part present and the box that holds it, so many px wider on each side."""
    for p, box in enumerate(find_objects(part, max_label=24), start=1):
        if box is not None:
            rows, columns = (slice(max(0, s.start - reach), s.stop + reach) for s in box)
            yield p, (rows, columns)


def _ragged_part_borders(
    part: Parts, amplitude_px: float, scale: float, rng: np.random.Generator
) -> Parts:
    """Borders between parts moved, the silhouette kept."""
    height, width = part.shape
    wave = PART_WAVE_PX * scale
    x = np.arange(width, dtype=np.float32) + amplitude_px * smooth_noise(part.shape, wave, rng)
    y = amplitude_px * smooth_noise(part.shape, wave, rng)
    y += np.arange(height, dtype=np.float32)[:, None]
    moved = cv2.remap(part, x, y, cv2.INTER_NEAREST, borderMode=cv2.BORDER_REPLICATE)
    return cv2.copyTo(moved, cv2.min(part, moved), part.copy())  # where both are not 0


def _ragged_silhouette(
    part: Parts, amplitude_px: float, scale: float, rng: np.random.Generator
) -> tuple[Parts, np.ndarray]:
    """The silhouette's border moved.

    Returns: the parts left; and where the person has grown, as flat indices.
    """
    inside = (part > 0).astype(np.uint8)
    depth = cv2.distanceTransform(inside, cv2.DIST_L2, 3)
    depth -= cv2.distanceTransform(1 - inside, cv2.DIST_L2, 3)
    depth += np.float32(0.5) - inside  # the border runs between pixels
    wanted = depth > amplitude_px * smooth_noise(part.shape, SILHOUETTE_WAVE_PX * scale, rng)
    return part * wanted.view(np.uint8), np.flatnonzero(wanted & (part == 0))


def _fill_parts(iuv: Iuv, part: Parts, grown: np.ndarray, reach_px: int) -> Iuv:
    """The IUV with new parts.

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
    """Where near some places (flat indices) an image has the values wanted there.

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
    """Steps (down, right) within a radius, the shortest first, in batches of growing length."""
    span = range(-radius, radius + 1)
    steps = [(y, x) for y in span for x in span if 0 < y * y + x * x <= radius * radius]
    steps.sort(key=lambda step: step[0] ** 2 + step[1] ** 2)
    return tuple(np.split(np.array(steps), [4, 20]))


def _drift(iuv: Iuv, drift: float, shift: float, rng: np.random.Generator) -> None:
    """Change U and V of a person in place, differently in each part."""
    part = cv2.extractChannel(iuv, 0)
    wave = DRIFT_WAVE_SHARE * max(part.shape)
    gain, constant = np.zeros((2, 2, 256), np.float32)
    gain[:, 1:25] = 255 * drift * rng.standard_normal((2, 24), np.float32)
    constant[:, 1:25] = 255 * shift * rng.standard_normal((2, 24), np.float32)
    for channel in (0, 1):
        error = cv2.multiply(cv2.LUT(part, gain[channel]), smooth_noise(part.shape, wave, rng))
        error += cv2.LUT(part, constant[channel])
        changed = cv2.add(
            cv2.extractChannel(iuv, channel + 1), error, dtype=cv2.CV_8U
        )  # rounds and saturates
        cv2.insertChannel(changed, iuv, channel + 1)


def _punch_holes(iuv: Iuv, count: float, scale: float, rng: np.random.Generator) -> None:
    """Small holes, in place."""
    person = np.flatnonzero(iuv[..., 0])
    if len(person) == 0:
        return
    for centre in rng.choice(person, rng.poisson(count)):
        y, x = divmod(int(centre), iuv.shape[1])
        axes = np.rint(rng.uniform(0.5, 2.5, 2) * scale).astype(int).tolist()
        cv2.ellipse(iuv, (x, y), axes, rng.uniform(0, 180), 0, 360, (0, 0, 0), cv2.FILLED)
