"""The skin and the eyes as pieces."""

from __future__ import annotations

import numpy as np

from motion_transfer.people.figure.body import Body, BodyModel
from motion_transfer.people.figure.mesh import Material, Piece
from motion_transfer.people.head.face_paint import paint_eyes, paint_skin
from motion_transfer.people.head.face_wear import wear_pieces
from motion_transfer.people.head.faces import Face
from motion_transfer.people.head.skin_atlas import HEAD_ROWS, STRIP_ROWS, WIDTH, skin_atlas

# metres that a whole texture of 448 columns would show at the face's scale of about 1 mm a texel
_SKIN_METRES = (WIDTH / 1000, (HEAD_ROWS + STRIP_ROWS) / 1000)


def skin_pieces(face: Face, body: Body, model: BodyModel) -> list[Piece]:
    """The body's skin with its face painted on, the eyes, and what sits on the face.

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
