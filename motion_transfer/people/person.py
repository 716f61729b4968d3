"""A person: who they are and what they wear, and the geometry of it."""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from functools import lru_cache
from typing import Any, Protocol

import numpy as np

from motion_transfer.people.clothes.garments import DressedBody
from motion_transfer.people.clothes.outfits import sample_outfit
from motion_transfer.people.clothes.surface import BodySurface
from motion_transfer.people.clothes.wardrobe import Outfit
from motion_transfer.people.figure.body import Body, BodyModel, Shape
from motion_transfer.people.figure.mesh import Piece, PosedBody
from motion_transfer.people.head.faces import Face, sample_face
from motion_transfer.people.head.hair import Hair, hair_pieces, sample_hair
from motion_transfer.people.head.skin import skin_pieces
from motion_transfer.people.motion.capsules import Capsules
from motion_transfer.people.motion.poses import Pose, posed
from motion_transfer.people.motion.untangling import untangled
from motion_transfer.people.picture.shade import Scene


@dataclass(frozen=True)
class Person:
    """Everything that stays the same between two pictures of somebody."""

    shape: Shape
    face: Face
    hair: Hair
    outfit: Outfit

    def description(self) -> dict[str, Any]:
        """Describe the person in plain numbers, words and lists, for JSON."""
        return asdict(self)

    def pieces(self, body: Body, model: BodyModel) -> list[Piece]:
        """Make skin, garments and hair at rest on a body of that shape; the skin comes first."""
        skin, *rest = skin_pieces(self.face, body, model)
        dressed = DressedBody(self.outfit, body, body_surface(model))
        covered = replace(skin, keep=np.minimum(skin.keep, dressed.keep))
        return [covered, *rest, *dressed.pieces, *hair_pieces(self.hair, body, model)]


class Somebody(Protocol):
    """Who can be dressed and photographed: a `Person`, or one made otherwise."""

    @property
    def shape(self) -> Shape:
        """The body's build."""
        ...

    def description(self) -> dict[str, Any]:
        """Describe the person in plain numbers, words and lists, for JSON."""
        ...

    def pieces(self, body: Body, model: BodyModel) -> list[Piece]:
        """Make skin, garments and hair at rest on a body of that shape; the skin comes first."""
        ...


def sample_person(rng: np.random.Generator) -> Person:
    """Sample anybody, over the whole range of adult bodies."""
    shape = sample_shape(rng)
    face = sample_face(rng, shape)
    # hair before the outfit: numbers are drawn in this order
    return Person(shape, face, sample_hair(rng, shape, face), sample_outfit(rng, shape))


def sample_shape(rng: np.random.Generator) -> Shape:
    """Sample an adult's build: most are near the middle, some far from it.

    Middles and widths are chosen by eye, so that streets would look alike.
    """
    female = rng.random() < 0.55
    gender = 1 - abs(rng.normal(0, 0.12)) if female else abs(rng.normal(0, 0.12))

    def spread(middle: float, width: float) -> float:
        return float(np.clip(rng.normal(middle, width), 0, 1))

    origins = rng.dirichlet((0.5, 0.5, 0.5))  # below 1: mostly one of them, seldom an even mixture
    return Shape(
        gender=float(np.clip(gender, 0, 1)),
        age=float(0.64 + 0.34 * rng.beta(1.0, 2.4)),  # adults, the young ones more often
        muscle=spread(0.5, 0.17),
        weight=spread(0.46, 0.18),
        height=spread(0.5, 0.17),
        proportions=spread(0.62, 0.2),
        cupsize=spread(0.45, 0.18),
        firmness=spread(0.6, 0.2),
        african=float(origins[0]),
        asian=float(origins[1]),
        caucasian=float(origins[2]),
    )


body_surface = lru_cache(maxsize=1)(BodySurface)
"""Fields over the skin, once for all people of a model."""


class DressedPerson:
    """A person's geometry at rest, ready for any number of poses.

    Attributes:
        model: What the body was made by.
        body: The bare body at rest.
        pieces: Skin, garments, hair; the skin comes first.
        scene: The pieces, ready to be drawn.
    """

    def __init__(self, person: Somebody, model: BodyModel) -> None:
        self.person = person
        self.body: Body = model.body(person.shape)
        self.model = model
        self._capsules = Capsules(model, self.body)
        self.pieces = person.pieces(self.body, model)
        self.scene = Scene(self.pieces)

    def posed(self, pose: Pose) -> PosedBody:
        """Pose the body on the floor; limbs that would go through it are moved aside."""
        return posed(self.body, untangled(pose, self._capsules), self.model)
