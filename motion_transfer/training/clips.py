"""Clips of one person each, as in the Fashion data set: videos with the IUV of every frame."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from motion_transfer.drawing.person import choose_person, find_people, isolate
from motion_transfer.errors import InputError
from motion_transfer.media.iuv.formats import ChannelOrder, list_clip_iuv_names
from motion_transfer.media.iuv.opening import open_reader, open_stream
from motion_transfer.media.iuv.stream import IuvReader
from motion_transfer.media.pictures.formats import VIDEO_SUFFIXES
from motion_transfer.media.pictures.video import IndexedVideo
from motion_transfer.training.pairs import (
    Done,
    Pair,
    PairList,
    check_pairs,
    ignore_done,
    list_problems,
)
from motion_transfer.training.pictures import PersonPicture

IUV_ENDINGS = ("_IUV", "_iuv")
DEFAULT_MOMENTS = 8


@dataclass(frozen=True)
class Clip:
    """A video and the IUV of its frames."""

    name: str
    video: IndexedVideo
    iuv: IuvReader


@dataclass(frozen=True)
class ClipFrame:
    """A frame of a clip. Of several people the largest counts."""

    clip: Clip
    index: int

    @property
    def name(self) -> str:
        return f"{self.clip.name}/{self.index:06d}"

    def load(self) -> PersonPicture:
        """Read the frame and its IUV.

        Raises: InputError if the frame is broken, sizes differ, or it shows nobody.
        """
        rgb = self.clip.video.read(self.index)
        (iuv,) = self.clip.iuv.read(self.index, self.index + 1)
        where = f"frame {self.index} of {self.clip.video.path}"
        if iuv.shape != rgb.shape:
            raise InputError(
                f"{where} is {rgb.shape[1]} x {rgb.shape[0]}, but its IUV is {iuv.shape[1]} x"
                f" {iuv.shape[0]}"
            )
        people = find_people(iuv)
        person = choose_person(people, "largest", where)
        if len(person.regions) != people.region_count:  # somebody else is seen as well
            iuv = isolate(iuv, person)
        return PersonPicture(self.name, rgb, iuv, None)


def list_files(folder: Path, suffixes: Sequence[str], without: tuple[str, ...]) -> list[Path]:
    """List a folder's photos or videos in order, but for hidden ones and some ends of the stem."""
    return [
        path
        for path in sorted(folder.iterdir())
        if path.suffix.lower() in suffixes
        and not path.stem.endswith(without)
        and not path.name.startswith(".")
    ]


def open_clips(
    folder: Path, *, iuv_order: ChannelOrder | None = None
) -> tuple[list[Clip], list[str]]:
    """Open the clips of a folder in order of name; tell what is wrong with others, a line each.

    A clip is `NAME.mp4` (or another video) with `NAME_IUV` or `NAME_iuv` beside it: a folder of
    IUV images, a lossless video, `.npy` or `.npz`, with as many frames.

    Raises: InputError if the folder is missing or holds no video.
    """
    if not folder.is_dir():
        raise InputError(f"folder of clips {folder} does not exist")
    videos = list_files(folder, VIDEO_SUFFIXES, IUV_ENDINGS)
    if not videos:
        raise InputError(f"folder {folder} holds no videos ({', '.join(VIDEO_SUFFIXES)})")
    clips, problems = [], []
    for path in videos:
        try:
            if any(clip.name == path.stem for clip in clips):
                raise InputError("another video has the same name but for its ending; rename one")
            clips.append(_open_clip(path, iuv_order))
        except InputError as error:
            problems.append(f"{path.name}: {error}")
    return clips, problems


def open_clip_pairs(
    folder: Path,
    *,
    moments: int = DEFAULT_MOMENTS,
    iuv_order: ChannelOrder | None = None,
    limit: int | None = None,
    skip_broken: bool = False,
    done: Done = ignore_done,
) -> PairList:
    """Open pairs of frames of one clip, always the same, after each was checked.

    Args:
        moments: Of a clip, see `choose_frames`.
        limit: Only the first so many clips.
    Raises: InputError as `motion_transfer.training.pairs.open_pairs` does.
    """
    clips, problems = open_clips(folder, iuv_order=iuv_order)
    entries = []
    for clip in clips[:limit]:
        source = ClipFrame(clip, 0)
        for index in choose_frames(clip.video.frame_count, moments):
            pair = Pair(source, ClipFrame(clip, index), group=clip.name, frame=index)
            entries.append((clip.name, pair))
    if not entries:
        raise InputError(*list_problems(f"folder {folder} holds no pair of frames", problems))
    return check_pairs(folder.name, entries, problems, skip_broken=skip_broken, done=done)


def choose_frames(frame_count: int, moments: int) -> Sequence[int]:
    """Choose which frames of a clip are targets; the first one is the source.

    Moments are spread evenly over the clip, and each gives two frames in a row, so that flicker
    can be measured.
    """
    if frame_count < 3:
        return range(1, frame_count)
    last = frame_count - 2  # the last target but one: its successor is a target, too
    starts = [1 + (last - 1) * step // max(1, moments - 1) for step in range(moments)]
    return sorted({frame for start in starts for frame in (start, start + 1)})


def _open_clip(path: Path, order: ChannelOrder | None) -> Clip:
    iuv_path = next((name for name in list_clip_iuv_names(path) if name.exists()), None)
    if iuv_path is None:
        raise InputError(
            f"no IUV beside it; expected {path.stem}_iuv/, {path.stem}_IUV.mkv or .npz"
        )
    video, reader = IndexedVideo(path), open_reader(open_stream(iuv_path), order)
    if video.frame_count != reader.stream.frame_count:
        raise InputError(
            f"it has {video.frame_count} frames, but {iuv_path.name} has"
            f" {reader.stream.frame_count}"
        )
    return Clip(path.stem, video, reader)
