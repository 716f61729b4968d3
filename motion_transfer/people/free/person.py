"""A free person: the project's body in a photographed skin, clothes and hair of either kind."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict, dataclass, field, replace
from typing import Any

import numpy as np
from numpy.random import Generator

from motion_transfer.people.clothes.garments import DressedBody
from motion_transfer.people.figure.body import Body, BodyModel, Points, Shape
from motion_transfer.people.figure.mesh import Material, Piece
from motion_transfer.people.figure.picture import Overlay
from motion_transfer.people.free.assets import BODY_POINTS, Assets, Colour, Item, load_mesh
from motion_transfer.people.free.binding import Garment, load_helpers, load_parts
from motion_transfer.people.free.look import SKIRTED, Dye, Look, Worn, sample_look
from motion_transfer.people.free.pictures import brightness, load_normals, load_picture
from motion_transfer.people.free.settling import hang_hair, hang_skirt
from motion_transfer.people.head.face_wear import wear_pieces
from motion_transfer.people.head.hair import hair_pieces
from motion_transfer.people.head.head_map import rigid
from motion_transfer.people.person import body_surface, sample_shape

HAIR_SHARE = 0.9  # of the hair's own colour; the rest is the picture's
DARK_CONTRAST = (
    3.0  # of a picture darker than a third, differences are mostly noise: they grow less
)
LIGHT_MEAN = 0.75  # of a dye lighter than that, bright threads are not much brighter
PLAIN = 0.4  # of a printed skirt's differences stay in one that is dyed: its cloth is nearly plain

_NO_TEXTURE = np.zeros((1, 1, 4), np.float32)
_SIZE_METRES = (1.0, 1.0)  # only relief is measured by it, and an overlay has none
_FINISH: dict[str, dict[str, Any]] = {  # by kind of item; by eye
    "skin": {"gloss": 0.045, "sharpness": 10.0, "translucency": 0.3},
    "shoes": {"gloss": 0.15, "sharpness": 30.0},
    "hair": {"gloss": 0.03, "sharpness": 20.0},
    "eyes": {"gloss": 0.25, "sharpness": 60.0},
}


@dataclass(frozen=True)
class FreePerson:
    """Everything that stays the same between two pictures of somebody."""

    shape: Shape
    look: Look
    assets: Assets = field(repr=False, compare=False)

    def description(self) -> dict[str, Any]:
        """Describe the person in plain numbers, words and lists, for JSON."""
        return {"kind": "free", "shape": asdict(self.shape), "look": asdict(self.look)}

    def pieces(self, body: Body, model: BodyModel) -> list[Piece]:
        """Make skin, garments and hair at rest on a body of that shape; the skin comes first.

        Raises: InputError for an item whose content cannot be used.
        """
        return list(_Dressing(self, body, model).pieces())


def sample_free_person(rng: Generator, assets: Assets, *, held_out: bool) -> FreePerson:
    """Sample anybody, over the whole range of adult bodies; see `sample_look`."""
    shape = sample_shape(rng)
    return FreePerson(shape, sample_look(rng, shape, assets, held_out=held_out), assets)


class _Dressing:
    """Puts the items of a look on a body."""

    def __init__(self, person: FreePerson, body: Body, model: BodyModel) -> None:
        self.look, self.assets = person.look, person.assets
        self.body, self.model = body, model
        self.rest: Points = load_helpers(self.assets).rest(body)
        self.hidden = np.zeros(len(self.rest), bool)

    def pieces(self) -> Iterator[Piece]:
        look = self.look
        worn = [self.garment(each) for each in look.clothes]
        skin = self.skin()
        if look.outfit:
            dressed = DressedBody(look.outfit, self.body, body_surface(self.model))
            skin = replace(skin, keep=dressed.keep)
            worn = dressed.pieces
        yield skin
        yield self.eyes()
        for name in (look.brows, look.lashes):
            if name:
                yield self.on_head(name)
        # painted beards and glasses; the face's other features are the skin's own
        yield from wear_pieces(
            replace(look.face, hair_colour=look.hair_colour), self.body, self.model
        )
        yield from worn
        if look.grown:
            yield from hair_pieces(look.grown, self.body, self.model)
        if look.hair:
            yield self.on_head(look.hair)
        if look.hat:
            yield self.on_head(look.hat, look.hat_picture)

    def skin(self) -> Piece:
        mesh = load_mesh(self.assets)
        shown = (mesh.faces < BODY_POINTS).all(1) & ~self.hidden[mesh.faces].all(1)
        picture = load_picture(self.assets.items[self.look.skin], "diffuse", self.assets)
        return Piece(
            name="skin",
            points=self.body.points,
            faces=np.ascontiguousarray(self.model.faces[shown]),
            weights=self.model.weights,
            corner_uv=np.ascontiguousarray(mesh.corner_uv[shown]),
            material=_overlaid("skin", Overlay(picture, gain=self.look.tone)),
            keep=np.ones(len(self.body.points), np.float32),
        )

    def garment(self, worn: Worn) -> Piece:
        item = self.assets.items[worn.item]
        garment = load_parts(item, self.assets)[worn.part]
        self.hidden |= garment.hidden
        piece = self.piece(item, self.overlay(item, "diffuse", worn.dye, worn.part), garment)
        if item.kind == "skirt" or (item.name in SKIRTED and worn.part == "lower"):
            hung = hang_skirt(piece.points, self.body, body_surface(self.model))
            piece = replace(piece, weights=hung.weights, settle=hung.settle)
        return piece

    def eyes(self) -> Piece:
        picture = load_picture(self.assets.items[self.look.eyes], "diffuse", self.assets)
        return self.piece(self.assets.of("eyes")[0], Overlay(picture))

    def on_head(self, name: str, role: str = "diffuse") -> Piece:
        """Make hair, a hat, brows or lashes."""
        item = self.assets.items[name]
        dyed = item.kind in ("hair", "eyebrows")
        dye = Dye(self.look.hair_colour, HAIR_SHARE) if dyed else None
        piece = self.piece(item, self.overlay(item, role, dye))
        if item.kind not in ("hair", "hat"):
            return piece
        settle = None
        if item.kind == "hair":
            settle = hang_hair(piece.points, piece.faces, self.body, self.model)
        # bones of the face and the neck would stretch it
        return replace(piece, weights=rigid(self.model, len(piece.points)), settle=settle)

    def overlay(self, item: Item, role: str, dye: Dye | None, part: str = "whole") -> Overlay:
        picture, normals = load_picture(item, role, self.assets), load_normals(item)
        if dye is None:
            return Overlay(picture, normals, cut_out=item.alpha)
        mean = brightness(item, part, self.assets)
        return Overlay(
            picture,
            normals,
            tint=dye.colour,
            tint_share=dye.share,
            mean=mean,
            contrast=_contrast(mean, dye.colour) * (PLAIN if item.kind == "skirt" else 1.0),
            cut_out=item.alpha,
        )

    def piece(self, item: Item, overlay: Overlay, garment: Garment | None = None) -> Piece:
        garment = garment or load_parts(item, self.assets)["whole"]
        points = garment.fit(self.rest)
        return Piece(
            name=item.name,
            points=points,
            faces=garment.faces,
            weights=garment.weights,
            corner_uv=garment.corner_uv,
            material=_overlaid(item.kind, overlay),
            keep=np.ones(len(points), np.float32),
            two_sided=item.kind != "eyes",
        )


def _contrast(mean: float, colour: Colour) -> float:
    """Tell how much of a picture's differences in brightness a dyed cloth shows."""
    light = max(sum(colour) / 3, LIGHT_MEAN)
    return min(1.0, mean * DARK_CONTRAST) * (1 - (light - LIGHT_MEAN) / (1 - LIGHT_MEAN) * 0.6)


def _overlaid(kind: str, overlay: Overlay) -> Material:
    return Material(_NO_TEXTURE, _SIZE_METRES, overlay=overlay, **_FINISH.get(kind, {}))
