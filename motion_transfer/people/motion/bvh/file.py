"""Reading BVH (Biovision hierarchy) motion capture files.

Source: the format as M. Meredith and S. Maddock describe it, Motion Capture File Formats Explained
(University of Sheffield, 2001). There is no standard; where files differ, `BvhMotion` says what is
taken to hold.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from fractions import Fraction
from pathlib import Path

import numpy as np
from jaxtyping import Float64

from motion_transfer.errors import InputError
from motion_transfer.media.files import read_bytes
from motion_transfer.option import read_fraction, read_whole
from motion_transfer.people.motion.limbs import Vector

CHANNELS = ("Xposition", "Yposition", "Zposition", "Xrotation", "Yrotation", "Zrotation")
_SPELLING = {name.lower(): name for name in CHANNELS}
LARGEST = 1e9  # micrometres in a kilometre: no unit of length or angle needs more
MOST_JOINTS, DEEPEST = 1000, 100  # of a person with every finger, some 80 and 12
SHORTEST_SECONDS, LONGEST_SECONDS = 1e-4, 100.0  # of a frame
USUAL_RATES = (
    *(Fraction(n) for n in (24, 25, 30, 48, 50, 60, 72, 90, 100, 120, 125, 144, 150, 200, 240)),
    *(Fraction(n * 1000, 1001) for n in (24, 30, 60, 120)),
)
"""Frames per second of cameras and of motion capture systems."""


@dataclass(frozen=True)
class BvhMotion:
    """A skeleton and its motion, as in the file.

    Attributes:
        path: The file, for messages.
        names: Each joint's name; parents come first.
        parents: Index of each joint's parent, -1 for the root.
        lines: The line on which each joint stands in the file, from 1.
        offsets: Joints x 3, from the parent, in the file's unit and axes.
        ends: Joint -> offset of its `End Site`.
        channels: Each joint's, in the file's order, spelt as in `CHANNELS`.
        frames: N x channels; positions in the file's unit, rotations in degrees.
        frame_seconds: How long a frame lasts, exactly as written.
    """

    path: Path
    names: tuple[str, ...]
    parents: tuple[int, ...]
    lines: tuple[int, ...]
    offsets: Float64[np.ndarray, "joints 3"]
    ends: dict[int, Vector]
    channels: tuple[tuple[str, ...], ...]
    frames: Float64[np.ndarray, "N channels"]
    frame_seconds: Fraction

    @property
    def frame_rate(self) -> Fraction:
        """Find the frames per second; a usual rate where a rounded frame time means one."""
        rate = 1 / self.frame_seconds
        # 29.97 and 30 are 1/1000 apart
        near = (usual for usual in USUAL_RATES if abs(rate / usual - 1) < Fraction(1, 5000))
        return next(near, rate)


@dataclass
class _Joint:
    name: str
    parent: int
    line: int
    offset: list[float] = field(default_factory=list)
    end: list[float] = field(default_factory=list)
    channels: tuple[str, ...] = ()


@dataclass
class _Reader:
    """Walks over the lines of a file and knows where it is."""

    path: Path
    lines: list[str]
    at: int = 0  # number of the line that was read last

    def error(self, message: str) -> InputError:
        """Make the error that says what is wrong in the line that was read last."""
        return InputError(f"{self.path}, line {self.at}: {message}")

    def words(self, wanted: str) -> list[str]:
        """Read the next line that is not empty. Raises: InputError at the file's end."""
        while self.at < len(self.lines):
            self.at += 1
            if words := self.lines[self.at - 1].split():
                return words
        raise self.error(f"the file ends where {wanted} was expected")

    def numbers(self, words: list[str]) -> list[float]:
        """Read words as finite numbers. Raises: InputError."""
        values = []
        for word in words:
            try:
                values.append(float(word))
            except ValueError:
                raise self.error(f"{_shown([word])} is not a number") from None
            if not abs(values[-1]) <= LARGEST:  # NaN is no less than anything
                raise self.error(f"{_shown([word])} is no length, angle or time of a person")
        return values

    def whole(self, word: str, what: str) -> int:
        """Read a word as a whole number, from 0. Raises: InputError."""
        try:
            number = read_whole(word)
        except ValueError:
            number = -1
        if number < 0:
            raise self.error(what)
        return number


def read_bvh(path: Path | str) -> BvhMotion:
    """Read a file, strictly.

    Raises: InputError that names the file, the line and what was expected there.
    """
    path = Path(path)
    reader = _Reader(path, _lines(path))
    words = reader.words("HIERARCHY")
    if [word.upper() for word in words] != ["HIERARCHY"]:
        raise reader.error(f"{_shown(words)} instead of HIERARCHY; this is not a BVH file")
    joints = _read_joints(reader)
    count, promised, seconds = _read_motion_head(reader)
    width = sum(len(joint.channels) for joint in joints)
    return BvhMotion(
        path=path,
        names=tuple(joint.name for joint in joints),
        parents=tuple(joint.parent for joint in joints),
        lines=tuple(joint.line for joint in joints),
        offsets=np.array([joint.offset for joint in joints], np.float64),
        ends={i: np.array(joint.end) for i, joint in enumerate(joints) if joint.end},
        channels=tuple(joint.channels for joint in joints),
        frames=np.array(list(_read_frames(reader, width, count, promised))),
        frame_seconds=seconds,
    )


def _lines(path: Path) -> list[str]:
    data = read_bytes(path, "motion")
    if not data.strip():
        raise InputError(f"{path}, line 1: the file is empty")
    text, wrong = "", data.find(b"\0")
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        wrong = error.start
    if wrong >= 0:
        line = data[:wrong].count(b"\n") + 1
        raise InputError(f"{path}, line {line}: this is not text, so not a BVH file")
    return text.splitlines()


def _shown(words: list[str]) -> str:
    text = " ".join(words)
    return repr(text if len(text) <= 40 else text[:37] + "...")


def _read_joints(reader: _Reader) -> list[_Joint]:
    """Read everything from ROOT to its closing brace."""
    words = reader.words("ROOT")
    if words[0].upper() != "ROOT" or len(words) < 2:
        raise reader.error(f"{_shown(words)} instead of ROOT and a name")
    joints = [_begin_joint(reader, words, -1)]
    inside = [0]  # of which joints the line is, as their numbers
    while inside:
        words = reader.words("a closing brace of the skeleton")
        key, joint = words[0].upper(), joints[inside[-1]]
        if key == "}":
            if not joint.offset:
                raise reader.error(f"joint {joint.name} has no OFFSET")
            inside.pop()
        elif key == "JOINT" and len(words) > 1:
            joints.append(_begin_joint(reader, words, inside[-1]))
            inside.append(len(joints) - 1)
            if len(joints) > MOST_JOINTS or len(inside) > DEEPEST:
                raise reader.error(
                    f"more than {MOST_JOINTS} joints, or {DEEPEST} in each other, are no person's"
                )
        elif key == "END":
            joint.end = _read_end_site(reader)
        elif key == "OFFSET":
            joint.offset = _offset(reader, words)
        elif key == "CHANNELS":
            joint.channels = _channels(reader, words)
        elif key in ("MOTION", "ROOT", "HIERARCHY"):
            raise reader.error(
                f"{key} inside of joint {joint.name}: a closing brace is missing before"
            )
        else:
            raise reader.error(f"{_shown(words)} instead of JOINT, OFFSET, CHANNELS or a brace")
    return joints


def _begin_joint(reader: _Reader, words: list[str], parent: int) -> _Joint:
    name = " ".join(words[1:])
    joint = _Joint(name.removesuffix("{").strip(), parent, reader.at)
    if not name.endswith("{"):
        _open_brace(reader, f"joint {joint.name}")
    return joint


def _open_brace(reader: _Reader, where: str) -> None:
    words = reader.words("an opening brace")
    if words != ["{"]:
        raise reader.error(f"{_shown(words)} instead of the opening brace of {where}")


def _offset(reader: _Reader, words: list[str]) -> list[float]:
    if len(words) != 4:
        raise reader.error(f"OFFSET takes 3 numbers, here are {len(words) - 1}")
    return reader.numbers(words[1:])


def _read_end_site(reader: _Reader) -> list[float]:
    if not reader.lines[reader.at - 1].rstrip().endswith("{"):
        _open_brace(reader, "the End Site")
    words = reader.words("OFFSET")
    if words[0].upper() != "OFFSET":
        raise reader.error(f"{_shown(words)} instead of the End Site's OFFSET")
    offset = _offset(reader, words)
    if reader.words("a closing brace") != ["}"]:
        raise reader.error("the End Site's closing brace is missing")
    return offset


def _channels(reader: _Reader, words: list[str]) -> tuple[str, ...]:
    said = reader.whole(" ".join(words[1:2]), "CHANNELS takes a count and that many names")
    names = words[2:]
    if said != len(names):
        raise reader.error(f"CHANNELS says {said}, here are {len(names)} names")
    wrong = [name for name in names if name.lower() not in _SPELLING]
    if wrong:
        raise reader.error(f"unknown channel {_shown(wrong[:1])}; there are {', '.join(CHANNELS)}")
    spelt = tuple(_SPELLING[name.lower()] for name in names)
    if len(set(spelt)) != len(spelt):
        raise reader.error("a channel occurs twice")
    return spelt


def _read_motion_head(reader: _Reader) -> tuple[int, int, Fraction]:
    """Read MOTION, Frames: and Frame Time:; the count, its line, and the exact time."""
    words = reader.words("MOTION")
    if words[0].upper() != "MOTION":
        brace = " (a closing brace too many)" if words == ["}"] else ""
        raise reader.error(f"{_shown(words)} instead of MOTION{brace}")
    words = reader.words("Frames:")
    label, _, rest = " ".join(words).partition(":")
    wanted = f"{_shown(words)} instead of Frames: and a whole number"
    if label.strip().lower() != "frames":
        raise reader.error(wanted)
    count, line = reader.whole(rest, wanted), reader.at
    if count == 0:
        raise reader.error("there are no frames")
    words = reader.words("Frame Time:")
    label, _, rest = " ".join(words).partition(":")
    if label.lower().split() != ["frame", "time"]:
        raise reader.error(f"{_shown(words)} instead of Frame Time: and seconds")
    (seconds,) = reader.numbers([rest.strip()])
    if not SHORTEST_SECONDS <= seconds <= LONGEST_SECONDS:
        raise reader.error(
            f"the frame time is {seconds:g} s; it must lie between {SHORTEST_SECONDS:g} and"
            f" {LONGEST_SECONDS:g}"
        )
    try:
        return count, line, read_fraction(rest.strip())
    except ValueError:  # more digits than are of use
        return count, line, Fraction(seconds)


def _read_frames(reader: _Reader, width: int, count: int, promised: int) -> Iterator[list[float]]:
    for frame in range(count):
        try:
            words = reader.words("a frame")
        except InputError:
            raise reader.error(f"the file ends after {frame} of {count} frames") from None
        if len(words) != width:
            raise reader.error(f"frame {frame} has {len(words)} values, the channels are {width}")
        yield reader.numbers(words)
    while reader.at < len(reader.lines):
        reader.at += 1
        if reader.lines[reader.at - 1].strip():
            raise reader.error(f"more lines than frames, of which line {promised} promises {count}")
