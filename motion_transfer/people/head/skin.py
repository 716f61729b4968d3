"""The skin and the eyes as pieces, a face painted on the one and an iris on the other.

Features are symmetric, so the left half is painted and mirrored; what differs between the sides
is noise: mottling, freckles, single hairs. Lengths are metres on the template's face; places, sizes
and tints of features were chosen by eye on it.
"""

from __future__ import annotations

import cv2
import numpy as np
from jaxtyping import Float32

from motion_transfer.people.figure.body import Body, BodyModel
from motion_transfer.people.figure.mesh import Material, Piece
from motion_transfer.people.head.brushes import (
    MOUTH_Z,
    Grid,
    Image,
    bald_crown,
    beard_cover,
    hairline_height,
    lay,
    noise,
    ramp,
    tint,
)
from motion_transfer.people.head.face_wear import wear_pieces
from motion_transfer.people.head.faces import Face, greyed
from motion_transfer.people.head.skin_atlas import (
    EYE_PX,
    EYE_SPAN,
    HEAD_ROWS,
    STRIP_ROWS,
    WIDTH,
    SkinAtlas,
    skin_atlas,
)
from motion_transfer.people.picture.paint import to_linear

_EYE_X, _EYE_Z = 0.0330, 1.7208  # the middle of the opening between the lids
# what the whole texture would show at the face's scale of about 1 mm a texel
_SKIN_METRES = (WIDTH / 1000, (HEAD_ROWS + STRIP_ROWS) / 1000)


def skin_pieces(face: Face, body: Body, model: BodyModel) -> list[Piece]:
    """Make the body's skin with its face painted on, the eyes, and what sits on the face.

    Returns: `skin`, whose points are all of `body.points` in their order (eyeballs are points
        without triangles), so that callers may cut it with a field over the body's vertices;
        `eyes`; then, where the face has them, `beard` and `glasses`.
    """
    atlas = skin_atlas(model)
    skin = Piece(
        name="skin",
        points=body.points,
        faces=atlas.skin,
        weights=model.weights,
        corner_uv=atlas.skin_uv,
        material=Material(
            paint_skin(face, atlas), _SKIN_METRES, gloss=0.045, sharpness=10.0, translucency=0.3
        ),
        keep=np.ones(len(body.points), np.float32),
    )
    eyes = Piece(
        name="eyes",
        points=body.points[atlas.eye_points],
        faces=atlas.eyes,
        weights=model.weights.rows(atlas.eye_points),
        corner_uv=atlas.eye_uv,
        material=Material(paint_eyes(face), (0.06, 0.03), gloss=0.25, sharpness=60.0),
        keep=np.ones(len(atlas.eye_points), np.float32),
    )
    return [skin, eyes, *wear_pieces(face, body, model)]


def paint_skin(face: Face, atlas: SkinAtlas) -> Float32[np.ndarray, "rows columns 4"]:
    """Paint the skin, linear RGB and relief: the head above, the strip of other skin below."""
    skin = to_linear(face.complexion.colour)
    head = np.full((3, HEAD_ROWS, WIDTH), skin[:, None, None], np.float32)
    _paint_flush(head, face, atlas)
    _paint_lines(head, face, atlas)
    _paint_eyelids(head, face, atlas)
    _paint_nose(head, atlas)
    _paint_lips(head, face, atlas, skin)
    middle = WIDTH // 2
    head[:, :, :middle] = head[:, :, : middle - 1 : -1]
    _paint_mottling(head, face)
    _paint_hair(head, face, atlas)
    texture = np.zeros((HEAD_ROWS + STRIP_ROWS, WIDTH, 4), np.float32)
    cv2.mixChannels([*head], [texture[:HEAD_ROWS]], [0, 0, 1, 1, 2, 2])
    texture[HEAD_ROWS:, :, :3] = _strip(face, skin)
    return texture


def _window(
    atlas: SkinAtlas, degrees: tuple[float, float], heights: tuple[float, float]
) -> tuple[slice, slice, Grid, Grid]:
    """Find the little of the texture that a feature needs: what lies between angles and heights.

    Returns: rows and columns; x and z of the places there.
    """
    first, last = np.searchsorted(np.degrees(atlas.angle), degrees)
    top, bottom = np.searchsorted(-atlas.z, (-heights[1], -heights[0]))
    rows, columns = slice(top, bottom), slice(first, last)
    place = atlas.place[rows, columns]
    return rows, columns, place[..., 0], place[..., 2]


def _spot(x: Grid, z: Grid, at: tuple[float, float], size: tuple[float, float]) -> Grid:
    """Paint a soft spot: 1 in its middle, 1/e at `size` from it."""
    return np.exp(-(((x - at[0]) / size[0]) ** 2) - ((z - at[1]) / size[1]) ** 2)


def _streak(across: Grid, width: float) -> Grid:
    """Paint a soft line along which `across` is 0."""
    return np.exp(-((across / width) ** 2))


def _paint_flush(head: Image, face: Face, atlas: SkinAtlas) -> None:
    rows, columns, x, z = _window(atlas, (0, 88), (1.60, 1.76))
    cheeks = _spot(x, z, (0.047, 1.686), (0.022, 0.017))
    nose = _spot(x, z, (0, 1.684), (0.015, 0.011))
    chin = 0.4 * _spot(x, z, (0, 1.612), (0.02, 0.012))
    flush = face.complexion.flush * np.maximum(np.maximum(cheeks, 0.8 * nose), chin)
    image = head[:, rows, columns]
    tint(image, (1.0, 0.80, 0.78), flush)
    tint(image, (1.0, 0.62, 0.62), 0.7 * face.make_up.blush * cheeks)
    ear = (np.degrees(atlas.angle[columns]) > 76) & (z < 1.73) & (z > 1.67)
    tint(image, (1.0, 0.84, 0.80), 0.5 * ear.astype(np.float32))


def _paint_lines(head: Image, face: Face, atlas: SkinAtlas) -> None:
    strength = face.complexion.lines
    if strength < 0.05:
        return
    rows, columns, x, z = _window(atlas, (0, 60), (1.62, 1.79))
    t = np.clip((1.684 - z) / 0.042, 0, 1)  # down from the wing of the nose past the mouth
    fold = _streak(x - 0.020 - 0.016 * t**0.8, 0.0022)
    fold = fold * ramp(z, 1.636, 1.650) * (1 - ramp(z, 1.680, 1.688))
    bend = 0.002 * np.cos(x * 60) * np.sin(x * 130 + 1)  # so that lines are not drawn with a ruler
    forehead = sum(_streak(z - at + bend, 0.0011) for at in (1.757, 1.767, 1.778))
    forehead = forehead * (1 - ramp(x, 0.025, 0.045)) * ramp(strength - 0 * x, 0.3, 1)
    bags = _spot(x, z, (0.031, 1.7070), (0.011, 0.0022))
    lines = fold + 0.5 * forehead + 0.7 * bags
    tint(head[:, rows, columns], (0.80, 0.70, 0.66), strength * lines)


def _paint_eyelids(head: Image, face: Face, atlas: SkinAtlas) -> None:
    rows, columns, x, z = _window(atlas, (5, 45), (1.700, 1.750))
    away = atlas.opening[rows, columns]
    image, make_up = head[:, rows, columns], face.make_up
    # the line between the lids rises a little outwards
    above = ramp(z - 0.10 * (x - _EYE_X), _EYE_Z - 0.0010, _EYE_Z + 0.0015)
    socket = _spot(x, z, (0.030, 1.7215), (0.016, 0.012))
    tint(image, (0.84, 0.76, 0.76), 0.6 * socket)
    inner = _spot(x, z, (0.017, 1.722), (0.006, 0.008))
    tint(image, (0.72, 0.62, 0.60), 0.6 * inner)
    near = _streak(away, 7) * above
    lay(image, to_linear(make_up.eye_shadow), 0.75 * make_up.shadow * near)
    crease = _streak(away - 4.2, 0.9) * above
    tint(image, (0.55, 0.46, 0.44), 0.55 * crease * ramp(0.050 - x, 0, 0.006))
    lashes = np.array([0.022, 0.015, 0.012], np.float32)
    upper = (1 - ramp(away, 0.9 + 1.0 * make_up.liner, 2.6 + 1.3 * make_up.liner)) * above
    outward = 0.65 + 0.35 * ramp(x, 0.022, 0.040)
    lay(image, lashes, (0.75 + 0.2 * make_up.liner) * upper * outward)
    lower = (1 - ramp(away, 0.4, 2.0)) * (1 - above)
    lay(image, lashes * 2, (0.38 + 0.35 * make_up.liner) * lower * ramp(x, 0.020, 0.036))
    corner = _spot(x, z, (0.0195, 1.7188), (0.0022, 0.0018))
    tint(image, (0.85, 0.45, 0.42), 0.6 * corner)


def _paint_nose(head: Image, atlas: SkinAtlas) -> None:
    rows, columns, x, z = _window(atlas, (0, 25), (1.664, 1.70))
    # the fourth power makes a hole with an edge, not a soft spot
    nostril = np.exp(-(((np.abs(x) - 0.0088) / 0.0042) ** 4) - ((z - 1.6752) / 0.0026) ** 4)
    tint(head[:, rows, columns], (0.20, 0.13, 0.11), 0.85 * nostril)
    wing = _spot(x - 0.0200 + 0.12 * (z - 1.681), z, (0, 1.681), (0.0020, 0.007))
    tint(head[:, rows, columns], (0.66, 0.54, 0.52), 0.5 * wing)


def _paint_lips(head: Image, face: Face, atlas: SkinAtlas, skin: Float32[np.ndarray, " 3"]) -> None:
    rows, columns, x, z = _window(atlas, (0, 30), (1.622, 1.672))
    image = head[:, rows, columns]
    across = np.clip(x / 0.0255, 0, 1)
    full = 0.8 + 0.4 * face.lip_fullness
    bow = 1 - 0.22 * _streak(x, 0.0035)  # the dip in the middle of the upper lip
    above = 0.0098 * full * (1 - across**1.7) * bow
    below = 0.0118 * full * (1 - across**2) ** 0.7
    height = z - MOUTH_Z
    coverage = ramp(above - height, -0.0012, 0.0016) * ramp(height + below, -0.0014, 0.0022)
    coverage = coverage * (1 - ramp(across, 0.90, 1.0))
    lip = skin * np.array([0.86, 0.55, 0.55], np.float32) ** (0.55 + 0.9 * face.lip_redness)
    lay(image, lip, 0.85 * coverage)
    tint(image, (0.80, 0.72, 0.72), 0.5 * coverage * (height > 0))  # the upper one faces down
    lay(image, to_linear(face.make_up.lipstick), 0.9 * face.make_up.lips * coverage)
    shade = _spot(x, height + below, (0, -0.0045), (0.016, 0.0028))
    tint(image, (0.78, 0.70, 0.68), 0.6 * shade)
    line = _streak(height + 0.0006, 0.0014) * (1 - ramp(x, 0.0235, 0.0275))
    lay(image, lip * np.array([0.16, 0.11, 0.11], np.float32), 0.9 * line)
    corner = _spot(x, height, (0.0255, -0.0008), (0.0022, 0.0018))
    tint(image, (0.45, 0.36, 0.35), 0.8 * corner)


def _paint_mottling(head: Image, face: Face) -> None:
    # every layer of noise has a seed of its own, or mottling and stubble would fall together
    light = 1 + 0.018 * noise("blotches", face.seed, HEAD_ROWS, WIDTH)
    light += 0.012 * noise("pores", face.seed + 1, HEAD_ROWS, WIDTH)
    pale = light * (1 - 0.018 * noise("blotches", face.seed + 2, HEAD_ROWS, WIDTH))
    for plane, factor in zip(head, (light, pale, pale), strict=True):
        plane *= factor
    if face.complexion.freckles > 0:
        spots = ramp(noise("spots", face.seed + 3, HEAD_ROWS, WIDTH), 1.6, 2.8)
        tint(head, (0.66, 0.52, 0.42), 0.5 * face.complexion.freckles * spots)


def _paint_hair(head: Image, face: Face, atlas: SkinAtlas) -> None:
    """Paint brows, the shadow of a beard, and the scalp seen between hairs."""
    colour = to_linear(greyed(face.hair_colour, 0.8 * face.grey))
    _paint_brows(head, face, atlas)
    if face.beard != "none":
        cover = beard_cover(face.beard, atlas)
        short = np.clip(face.beard_length / 3, 0, 1)
        rows = slice(*np.searchsorted(-atlas.z, (-1.712, -1.585)))
        grain = np.clip(0.75 + 0.25 * noise("fine", face.seed + 5, HEAD_ROWS, WIDTH)[rows], 0, 1.2)
        lay(head[:, rows], 0.8 * colour, (0.30 + 0.55 * short) * cover[rows] * grain)
    if face.scalp > 0:
        rows = slice(0, int(np.searchsorted(-atlas.z, -1.62)))
        inside = atlas.z[rows, None] - hairline_height(atlas.angle, face.hairline)[None]
        inside = inside + 0.0025 * noise("spots", face.seed + 6, HEAD_ROWS, WIDTH)[rows]
        cover = ramp(inside, -0.004, 0.012)
        if face.hairline.crown > 0:
            cover = cover * (1 - face.hairline.crown * bald_crown(atlas.place[rows]))
        grain = np.clip(0.85 + 0.2 * noise("fine", face.seed + 7, HEAD_ROWS, WIDTH)[rows], 0, 1.1)
        # stubble darkens the skin; hair lighter than the skin hardly shows
        shows = np.clip(1.25 - colour.mean() / head[:, :8].mean(), 0.2, 1)
        lay(head[:, rows], colour, shows * face.scalp * cover * grain)


def _paint_brows(head: Image, face: Face, atlas: SkinAtlas) -> None:
    rows, left, x, z = _window(atlas, (0, 58), (1.725, 1.765))
    brows = face.brows
    start = 0.0345 - 0.5 * brows.length / 1000  # a brow's middle stays over the eye
    t = (x - start) / (brows.length / 1000)  # 0 at the nose, 1 at the temple
    peak = brows.arch / 1000 * (1 - ((t - 0.62) / 0.5) ** 2) + 0.0010
    middle = _EYE_Z + brows.height / 1000 + np.maximum(peak, -0.005)
    thick = brows.thickness / 1000 * (1.45 - 0.75 * np.clip(t, 0, 1) ** 1.5)
    depth = 0.5 * thick - np.abs(z - middle)
    colour = to_linear(greyed(face.hair_colour, 0.6 * face.grey)) * np.float32(0.6)
    for side, columns in ((1, left), (-1, slice(WIDTH - left.stop, WIDTH - left.start))):
        hairs = 0.0003 * noise("pores", face.seed + 11 + side, HEAD_ROWS, WIDTH)[rows, left]
        cover = ramp(depth + hairs, -0.0012, 0.0012) * ramp(t, -0.08, 0.24)
        cover = brows.strength * cover * (1 - ramp(t, 0.92, 1.08))
        lay(head[:, rows, columns], colour, cover[:, ::side])


def _strip(face: Face, skin: Float32[np.ndarray, " 3"]) -> Float32[np.ndarray, "rows columns 3"]:
    """Paint all other skin: row by row from pale through the skin's own colour to ruddy."""
    # dark skin has the palest palms beside the rest of it
    paler = np.float32(0.3 + face.complexion.tone)
    pale = skin + (1 - skin) * np.array([0.22, 0.17, 0.14], np.float32) * paler
    ruddy = skin * np.array([0.95, 0.82, 0.80], np.float32)
    kind = np.clip((np.arange(STRIP_ROWS) - 2) / (STRIP_ROWS - 6), 0, 1)
    stops = zip(pale, skin, ruddy, strict=True)
    rows = np.stack([np.interp(kind, (0, 0.45, 0.55, 1), (a, b, b, c)) for a, b, c in stops], 1)
    image = np.repeat(rows[:, None], WIDTH, 1).astype(np.float32)
    image *= 1 + 0.02 * noise("blotches", face.seed + 8, STRIP_ROWS, WIDTH)[..., None]
    image[-4:, -4:] = (0.020, 0.006, 0.005)  # inside of the mouth
    return image


def paint_eyes(face: Face) -> Float32[np.ndarray, "rows columns 4"]:
    """Paint both eyeballs' texture: two equal tiles, each centred on the eye's joint."""
    at = (np.arange(EYE_PX, dtype=np.float32) + 0.5) / EYE_PX * EYE_SPAN - EYE_SPAN / 2
    x, z = np.meshgrid(at, -at)
    r = np.hypot(x, z)
    white = np.array((0.62, 0.57, 0.54))[:, None, None]  # reddish in the corners
    image = np.full((3, EYE_PX, EYE_PX), white, np.float32)
    tint(image, (0.85, 0.55, 0.50), 0.5 * ramp(np.abs(x), 0.006, 0.013))
    iris = to_linear(face.iris)
    lay(image, iris * np.float32(0.35), 1 - ramp(r, 0.0056, 0.0070))  # its dark rim
    spokes = 1 + 0.25 * noise("spots", face.seed + 9, EYE_PX, EYE_PX)
    lay(image, iris, (1 - ramp(r, 0.0040, 0.0056)) * np.clip(spokes, 0, 1))
    lay(image, np.full(3, 0.006, np.float32), 1 - ramp(r, 0.0020, 0.0030))
    tint(image, (0.30, 0.26, 0.26), 0.9 * ramp(z, -0.0005, 0.0050))  # the upper lid's shadow
    glint = np.hypot(x + 0.0018, z - 0.0012)
    lay(image, np.full(3, 0.85, np.float32), 0.8 * (1 - ramp(glint, 0.0004, 0.0013)))
    tile = np.concatenate([image.transpose(1, 2, 0), np.zeros((EYE_PX, EYE_PX, 1), np.float32)], 2)
    return np.concatenate([tile, tile], 1)
