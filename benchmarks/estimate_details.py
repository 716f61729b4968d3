"""How right the hands and heads of estimated IUV are, drawn and only painted.

    .venv/bin/python benchmarks/estimate_details.py hands [--people 20]
    .venv/bin/python benchmarks/estimate_details.py heads [--people 75] [--assets MAKEHUMAN]

`hands`: large photos of held-out people: around each true hand, how many pixels have the right part
(background and body included), and how well the hand itself is covered, with hands that are looked
at once more and without.

`heads`: photos of held-out people, two each: how far off the direction of the head is, painted and
drawn. A direction is the turn of the head's mean surface that brings the places that IUV names
nearest to its pixels; it is compared with that of the exact IUV, and, as a check of the measure,
both with the turn of the person's own head. Around each head, how many pixels have the right part,
how far U and V are off, and how well the head is covered.

`--heavy` looks with the estimator blazepose-heavy.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import cv2
import numpy as np
from estimate import coloured
from scipy.spatial import KDTree

from motion_transfer.estimate.blazepose import BlazePoseEstimator, details
from motion_transfer.estimate.blazepose.faces import find_face
from motion_transfer.estimate.blazepose.hands import find_hands
from motion_transfer.estimate.clip import lay_iuv
from motion_transfer.estimate.surfaces.hand_surface import fit_turn
from motion_transfer.people import Camera, PeopleStream, load_body_model, load_charts

HANDS_SIZE, HEADS_SIZE = (768, 768), (512, 512)
LEAST_HAND = LEAST_HEAD = 24  # px
ENOUGH = 600  # pixels of each part, which tell a head's turn
HEAD = 23  # the first of its parts
HEAD_TURNS = {"frontal": 45, "profile": 110, "from behind": 180}
"""The most degrees that each looks past the camera."""

TO_PICTURE = np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]])  # x right, y down, z away from who looks


def main() -> None:
    parser = argparse.ArgumentParser(description="The estimator's hands and heads.")
    ways = parser.add_subparsers(required=True)
    common = argparse.ArgumentParser(add_help=False)
    common.add_argument("--heavy", action="store_true")
    common.add_argument(
        "--pictures", type=Path, help="write photo, exact, coarse and fine IUV here"
    )
    hands = ways.add_parser("hands", parents=[common])
    hands.add_argument("--people", type=int, default=20)
    hands.set_defaults(do=score_hands)
    heads = ways.add_parser("heads", parents=[common])
    heads.add_argument("--people", type=int, default=75)
    heads.add_argument("--assets", type=Path, help="of free people")
    heads.set_defaults(do=score_heads)
    options = parser.parse_args()
    options.do(options)


def score_hands(options: argparse.Namespace) -> None:
    """Print how right hands are, drawn and only painted."""
    people = PeopleStream(split="held-out", size=HANDS_SIZE)
    estimator = BlazePoseEstimator(heavy=options.heavy, most_people=1)
    rows, changed = [], 0
    for number in range(options.people):
        dressed = people.dress(number)
        for view in range(2):
            photo = people.take(dressed, people.shot(number, view))
            pair = []
            for find in (lambda *_: {}, find_hands):
                details.find_hands = find
                details.find_face = lambda _frame, _landmarks: None
                estimator.start_shot()
                pair.append(lay_iuv(estimator.estimate(photo.rgb), *photo.rgb.shape[:2])[..., 0])
            for part in (3, 4):
                x, y, width, height = cv2.boundingRect((photo.iuv[..., 0] == part).view(np.uint8))
                if max(width, height) < LEAST_HAND:
                    continue
                rim = max(width, height) // 4
                place = np.s_[max(0, y - rim) : y + height + rim, max(0, x - rim) : x + width + rim]
                true = photo.iuv[place][..., 0]
                found = [each[place] for each in pair]
                changed += bool((found[0] != found[1]).any())
                hands = [(each == part, true == part) for each in found]
                rows.append(
                    [float((each == true).mean()) for each in found]
                    + [float((a & b).sum() / (a | b).sum()) for a, b in hands]
                )
                if options.pictures:
                    options.pictures.mkdir(parents=True, exist_ok=True)
                    shown = [np.repeat(each[..., None] * 10, 3, 2) for each in (true, *found)]
                    picture = np.hstack([photo.rgb[place][..., ::-1], *shown])
                    cv2.imwrite(str(options.pictures / f"{number}-{view}-{part}.png"), picture)
    painted, drawn, coarse, fine = np.mean(rows, 0)
    print(f"{len(rows)} hands of {LEAST_HAND} px and more; {changed} of them drawn")
    print(f"parts right around them: painted {painted:.3f}, drawn {drawn:.3f}")
    print(f"intersection over union: painted {coarse:.3f}, drawn {fine:.3f}")


def score_heads(options: argparse.Namespace) -> None:
    """Print how right heads are, drawn and only painted, by how they are turned."""
    people = PeopleStream(split="held-out", size=HEADS_SIZE, assets=options.assets)
    estimator = BlazePoseEstimator(heavy=options.heavy, most_people=1)
    places = HeadPlaces()
    details.find_hands = lambda *_: {}  # they take longest, and change no head
    rows: dict[str, list[list[float]]] = {name: [] for name in HEAD_TURNS}
    for number in range(options.people):
        dressed = people.dress(number)
        for view in range(2):
            shot = people.shot(number, view)
            photo = people.take(dressed, shot)
            x, y, width, height = cv2.boundingRect((photo.iuv[..., 0] >= HEAD).view(np.uint8))
            if max(width, height) < LEAST_HEAD:
                continue
            exact = places.turn(photo.iuv)
            own = places.true_turn(photo.camera, dressed.posed(shot.pose).points)
            pair = []
            for find in (lambda _frame, _landmarks: None, find_face):
                details.find_face = find
                estimator.start_shot()
                pair.append(lay_iuv(estimator.estimate(photo.rgb), *photo.rgb.shape[:2]))
            rim = max(width, height) // 4
            place = np.s_[max(0, y - rim) : y + height + rim, max(0, x - rim) : x + width + rim]
            row = [degrees(exact, own), float((pair[0] != pair[1]).any())]
            for found in pair:
                turn = places.turn(found)
                row += [degrees(turn, exact), degrees(turn, own)]
                row += head_score(found[place], photo.iuv[place])
            away = abs(np.degrees(np.arctan2(-own[0, 2], own[2, 2])))
            rows[next(name for name, most in HEAD_TURNS.items() if away <= most)].append(row)
            if options.pictures:
                options.pictures.mkdir(parents=True, exist_ok=True)
                shown = [coloured(each[place]) for each in (photo.iuv, *pair)]
                picture = np.hstack([photo.rgb[place][..., ::-1], *shown])
                cv2.imwrite(str(options.pictures / f"{number}-{view}.png"), picture)
    rows["all"] = [row for each in rows.values() for row in each]
    rows["of them drawn"] = [row for row in rows["all"] if row[1]]
    for name, kept in rows.items():
        if not kept:
            continue
        values = np.array(kept)
        exact, drawn = values[:, :2].T
        print(
            f"{name}: {len(kept)} heads of {LEAST_HEAD} px and more, {drawn.sum():.0f} drawn; exact"
            f" IUV {np.median(exact):.1f} degrees from the person's own head"
        )
        for way, columns in (("painted", values[:, 2:7]), ("drawn", values[:, 7:])):
            off, own, parts, iou, uv = columns.T
            half, most = (np.percentile([off, own], share, axis=1) for share in (50, 90))
            print(
                f"  {way:8} off by {half[0]:.1f} degrees (90 %: {most[0]:.1f}), from the person's"
                f" own {half[1]:.1f} ({most[1]:.1f}); parts right {parts.mean():.3f},"
                f" IoU {iou.mean():.3f}, U and V {np.nanmean(uv):.4f}"
            )


class HeadPlaces:
    """Where on the middle of all heads a pixel of IUV lies, and so how a head is turned."""

    def __init__(self) -> None:
        model, charts = load_body_model(), load_charts()
        chosen = charts.part >= HEAD
        corners, uv = model.faces[chosen], charts.uv[chosen]
        bone = model.weights.matrix[:, [model.skeleton.index["head"]]].toarray()[:, 0]
        self._own = np.intersect1d(corners, np.flatnonzero(bone > 0.5))
        rest = (model.template.points - model.template.joint("head")) @ TO_PICTURE.T
        self._rest = rest[self._own]
        shares = np.array([(a, b, 3 - a - b) for a in range(4) for b in range(4 - a)]) / 3
        # only what the head's bone moves: the neck turns less
        values = np.concatenate([rest, bone[:, None]], 1)[corners]
        self._values = (shares @ values).reshape(-1, 4)
        self._trees: dict[int, tuple[KDTree, np.ndarray]] = {}
        for part in (HEAD, HEAD + 1):
            rows = np.repeat(charts.part[chosen] == part, len(shares))
            self._trees[part] = KDTree((shares @ uv).reshape(-1, 2)[rows]), self._values[rows]

    def turn(self, iuv: np.ndarray) -> np.ndarray:
        """Fit weak perspective to a head's pixels, so that few wrong ones do not count.

        Returns: 3 x 3, from the axes of the picture at rest; that from behind if there is no head.
        """
        pixels, places = [], []
        for part, (tree, values) in self._trees.items():
            y, x = np.nonzero(iuv[..., 0] == part)
            if not len(x):
                continue
            every = max(1, len(x) // ENOUGH)
            y, x = y[::every], x[::every]
            found = values[tree.query(iuv[y, x, 1:] / 255)[1]]
            own = found[:, 3] > 0.8
            pixels.append(np.stack([x, y], 1)[own] + 0.5)
            places.append(found[own, :3])
        if sum(map(len, pixels)) < LEAST_HEAD:
            return np.diag([-1.0, 1, -1])
        return fit_weak_perspective(np.concatenate(places), np.concatenate(pixels))

    def true_turn(self, camera: Camera, points: np.ndarray) -> np.ndarray:
        """Tell how the head of a posed body is turned, seen where it is in the picture."""
        seen = camera.project(points[self._own]).astype(np.float64)
        metres = seen[:, 2].mean()
        seen[:, 2] = (seen[:, 2] - metres) * camera.focal_px / metres
        return fit_turn(self._rest.astype(np.float32), seen.astype(np.float32))[1]


def fit_weak_perspective(places: np.ndarray, pixels: np.ndarray) -> np.ndarray:
    """Find the turn with which places, seen from far away, lie nearest to pixels."""
    weights = np.ones(len(places))
    turn, scale = None, 1.0
    for _ in range(12):
        share = weights / weights.sum()
        rest, seen = places - share @ places, pixels - share @ pixels
        if turn is None:
            root = np.sqrt(weights)[:, None]
            affine = np.linalg.lstsq(rest * root, seen * root, rcond=None)[0].T
            left, sizes, right = np.linalg.svd(affine, full_matrices=False)
            rows = left @ right
            turn, scale = np.vstack([rows, np.cross(*rows)]), float(sizes.mean())
        for _ in range(3):
            x, y, z = turned = (rest @ turn.T).T
            none = np.zeros_like(x)
            # how x and y change with a small turn about each axis, and with the scale
            slopes = np.stack([scale * np.stack([none, z, -y]), scale * np.stack([-z, none, x])])
            slopes = np.concatenate([slopes, turned[:2, None]], 1)
            away = seen.T - scale * turned[:2]
            normal = np.einsum("cin,n,cjn->ij", slopes, weights, slopes)
            step = np.linalg.solve(
                normal + 1e-6 * np.trace(normal) * np.eye(4),
                np.einsum("cin,n,cn->i", slopes, weights, away),
            )
            turn, scale = cv2.Rodrigues(step[:3])[0] @ turn, scale + float(step[3])
        far = np.linalg.norm(seen - scale * (rest @ turn.T)[:, :2], axis=1)
        weights = 1 / (1 + np.square(far / (1.5 * np.median(far) + 1e-6)))
    assert turn is not None
    return turn


def degrees(one: np.ndarray, other: np.ndarray) -> float:
    """The angle between two turns."""
    return float(np.degrees(np.arccos(np.clip((np.trace(one @ other.T) - 1) / 2, -1, 1))))


def head_score(found: np.ndarray, true: np.ndarray) -> list[float]:
    """The share of pixels with the right part, intersection over union of the heads, and the mean
    error of U and V where both are the same part of the head."""
    mine, yours = found[..., 0], true[..., 0]
    heads = mine >= HEAD, yours >= HEAD
    same = (mine == yours) & heads[1]
    away = np.abs(found[same][:, 1:].astype(int) - true[same][:, 1:]) / 255
    iou = (heads[0] & heads[1]).sum() / (heads[0] | heads[1]).sum()
    uv = float(away.mean()) if same.any() else float("nan")
    return [float((mine == yours).mean()), float(iou), uv]


if __name__ == "__main__":
    main()
