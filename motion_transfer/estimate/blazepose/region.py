"""Turned squares of a frame, and pixels into and out of them.

Convention: a region's own coordinates run from (0, 0) at its top left corner to (1, 1); frame
coordinates are pixels with centres at +0.5.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import atan2, cos, hypot, pi, radians, remainder, sin

import cv2
import numpy as np
from jaxtyping import Float32, UInt8

from motion_transfer.drawing.person import Box

ENLARGED = 1.25
"""Both graphs of MediaPipe take a region a quarter larger than the circle that holds the body."""

COARSE = 6
"""From so many frame pixels a pixel on, they are averaged first: bilinear sampling looks at four
only, and small people get lost. MediaPipe always samples."""

SAMPLING = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP


@dataclass(frozen=True)
class Region:
    """A square of the frame.

    Attributes:
        x, y: Its middle, frame pixels.
        side: Its length, frame pixels.
        turn: Clockwise, radians.
    """

    x: float
    y: float
    side: float
    turn: float = 0.0

    @classmethod
    def around_body(cls, hips: np.ndarray, top: np.ndarray) -> Region:
        """Lay the region that BlazePose wants: upright along the line from the hips to a point on
        the circle around the whole body.

        Args:
            hips: X and y of the middle of the hips, frame pixels.
            top: X and y of the point on the circle, above the head.
        Source: MediaPipe's pose_detection_to_roi and pose_landmarks_to_roi graphs.
        """
        x, y = float(top[0] - hips[0]), float(top[1] - hips[1])
        turn = pi / 2 - atan2(-y, x)
        turn -= 2 * pi * np.floor((turn + pi) / (2 * pi))  # into -pi..pi
        return cls(float(hips[0]), float(hips[1]), 2 * hypot(x, y) * ENLARGED, turn)

    @property
    def is_usable(self) -> bool:
        """Whether it is a square of a size that can be looked at."""
        return bool(np.isfinite([self.x, self.y, self.side, self.turn]).all() and self.side >= 2)

    def changed(self, degrees: float, scale: float) -> Region:
        """Turn it clockwise and make it so many times as large, about its middle."""
        return Region(self.x, self.y, self.side * scale, self.turn + radians(degrees))

    def has_middle_in(self, frame: np.ndarray) -> bool:
        """Tell whether its middle lies on a frame."""
        height, width = frame.shape[:2]
        return 0 <= self.x < width and 0 <= self.y < height

    def change_to(self, other: Region) -> float:
        """Measure how much another region differs: the most of what it is away and larger or
        smaller, in shares of this one's side, and turned, in radians."""
        away = hypot(other.x - self.x, other.y - self.y) / self.side
        turn = abs(remainder(other.turn - self.turn, 2 * pi))
        return max(away, abs(other.side / self.side - 1), turn)

    def to_frame(self, points: Float32[np.ndarray, "N 2"]) -> Float32[np.ndarray, "N 2"]:
        """Turn the region's own coordinates into frame pixels."""
        return self.rotate((points - 0.5) * self.side) + np.array([self.x, self.y], np.float32)

    def rotate(self, vectors: Float32[np.ndarray, "N 2"]) -> Float32[np.ndarray, "N 2"]:
        """Turn directions of the upright region into directions of the frame."""
        c, s = cos(self.turn), sin(self.turn)
        return (vectors @ np.array([[c, s], [-s, c]])).astype(np.float32)

    def matrix(self, size: int) -> np.ndarray:
        """Make the 2 x 3 matrix from pixels of the region seen at `size` x `size` to frame pixels,
        as OpenCV counts them.

        As in MediaPipe, for which the networks were made, the centre of the first pixel lies on
        the region's corner: half a pixel of the region off.
        """
        scale = self.side / size
        c, s = cos(self.turn) * scale, sin(self.turn) * scale
        half = size / 2
        corner = self.x - c * half + s * half, self.y - s * half - c * half
        return np.array([[c, -s, corner[0]], [s, c, corner[1]]])

    def cut(
        self, frame: UInt8[np.ndarray, "H W 3"], size: int, *, border: int = cv2.BORDER_CONSTANT
    ) -> UInt8[np.ndarray, "size size 3"]:
        """Look at the region at `size` x `size` px; outside the frame black or as `border` says.

        A region much larger than that is averaged and not only sampled.
        """
        matrix = self.matrix(size)
        reach = self.side / size
        if reach >= COARSE:
            # two to three pixels a pixel are left, which bilinear sampling sees all of
            frame, matrix = _shrink(frame, matrix, size, int(reach / 2))
        return cv2.warpAffine(frame, matrix, (size, size), flags=SAMPLING, borderMode=border)

    def paste(self, image: np.ndarray, box: Box) -> np.ndarray:
        """Put what was seen in the region, a square image, on a box of the frame; 0 outside."""
        matrix = cv2.invertAffineTransform(self.matrix(image.shape[0]))
        matrix[:, 2] += matrix[:, :2] @ (box.left, box.top)
        return cv2.warpAffine(image, matrix, (box.width, box.height), flags=SAMPLING)


def _shrink(
    frame: np.ndarray, matrix: np.ndarray, size: int, factor: int
) -> tuple[np.ndarray, np.ndarray]:
    """Make the part of the frame that the region reaches `factor` times smaller; and its matrix."""
    corners = matrix @ np.array([[0, size, 0, size], [0, 0, size, size], [1, 1, 1, 1]])
    room = np.array(frame.shape[1::-1])
    # a border of one averaged pixel, and never nothing at all, even of a region outside the frame
    low = np.clip(np.floor(corners.min(1)) - factor, 0, room - 1).astype(int)
    high = np.clip(np.ceil(corners.max(1)) + factor, low + 1, room).astype(int)
    part = frame[low[1] : high[1], low[0] : high[0]]
    small = [max(1, round(n / factor)) for n in part.shape[1::-1]]
    scale = np.array(small) / part.shape[1::-1]
    moved = matrix.copy()
    moved[:, 2] += 0.5 - low
    moved *= scale[:, None]
    moved[:, 2] -= 0.5
    return cv2.resize(part, small, interpolation=cv2.INTER_AREA), moved
