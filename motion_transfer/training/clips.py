"""Clips of one person each, as in the Fashion data set: videos with the IUV of every frame."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from motion_transfer.errors import InputError
from motion_transfer.media.iuv_image import ChannelOrder
from motion_transfer.media.iuv_stream import IuvReader, open_reader, open_stream
from motion_transfer.media.video import VIDEO_SUFFIXES, PictureVideo
from motion_transfer.render.person import choose_person, find_people, isolate
from motion_transfer.training.pairs import Entry, Pair, PairList, check_pairs, list_problems
from motion_transfer.training.pictures import PersonPicture

IUV_ENDINGS = ("_IUV", "_iuv")
IUV_SUFFIXES = (".mkv", ".avi", ".mov", ".npy", ".npz", "")  # the last: a folder of images
DEFAULT_MOMENTS = 8


@dataclass(frozen=True)
class Clip:
    """A video and the IUV of its frames."""

    name: str
    video: PictureVideo
    iuv: IuvReader

    @property
    def frame_count(self) -> int:
        return self.video.frame_count

    def frame(self, index: int) -> ClipFrame:
        """One of its frames; negative numbers count from the end."""
        return ClipFrame(self, range(self.frame_count)[index])


@dataclass(frozen=True)
class ClipFrame:
    """A frame of a clip. Of several people the largest counts."""

    clip: Clip
    index: int

    @property
    def name(self) -> str:
        return f"{self.clip.name}/{self.index:06d}"

    def load(self) -> PersonPicture:
        """Raises: InputError if the frame is broken, sizes differ, or it shows nobody."""
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
        if len(person.regions) != people.region_count:
            iuv = isolate(iuv, person)
        return PersonPicture(self.name, rgb, iuv, None)


def open_clips(
    folder: Path, *, iuv_order: ChannelOrder | None = None
) -> tuple[list[Clip], list[str]]:
    """The clips of a folder in order of name, and what is wrong with others, a line for each.

    A clip is `NAME.mp4` (or another video) with `NAME_IUV` or `NAME_iuv` beside it: a folder of
    IUV images, a lossless video, `.npy` or `.npz`, with as many frames.

    Raises: InputError if the folder is missing or holds no video.
    """
    if not folder.is_dir():
        raise InputError(f"folder of clips {folder} does not exist")
    videos = [
        path
        for path in sorted(folder.iterdir())
        if path.suffix.lower() in VIDEO_SUFFIXES
        and not path.stem.endswith(IUV_ENDINGS)
        and not path.name.startswith(".")
    ]
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
    done: Callable[[int, int], None] = lambda _count, _total: None,
) -> PairList:
    """Pairs of frames of one clip, always the same, after each was looked at.

    Args:
        moments: see `choose_frames`.
        limit: only the first so many clips.
    Raises: InputError as `motion_transfer.training.pairs.open_pairs`.
    """
    clips, problems = open_clips(folder, iuv_order=iuv_order)
    entries = []
    for clip in clips[:limit]:
        for index in choose_frames(clip.frame_count, moments):
            pair = Pair(clip.frame(0), clip.frame(index), group=clip.name, frame=index)
            entries.append(Entry(clip.name, pair))
    if not entries:
        raise InputError(list_problems(f"folder {folder} holds no pair of frames", problems))
    return check_pairs(folder.name, entries, problems, skip_broken=skip_broken, done=done)


def choose_frames(frame_count: int, moments: int) -> Sequence[int]:
    """Which frames of a clip are targets; the first one is the source.

    Moments are spread evenly over the clip, and each gives two frames in a row, so that flicker
    can be measured.
    """
    if frame_count < 3:
        return range(1, frame_count)
    last = frame_count - 2
    starts = [1 + (last - 1) * step // max(1, moments - 1) for step in range(moments)]
    return sorted({frame for start in starts for frame in (start, start + 1)})


def _open_clip(path: Path, order: ChannelOrder | None) -> Clip:
    beside = [
        path.with_name(f"{path.stem}{ending}{suffix}")
        for ending in IUV_ENDINGS
        for suffix in IUV_SUFFIXES
    ]
    iuv_path = next((candidate for candidate in beside if candidate.exists()), None)
    if iuv_path is None:
        raise InputError(
            f"no IUV beside it; expected {path.stem}_iuv/, {path.stem}_IUV.mkv or .npz"
        )
    video, reader = PictureVideo(path), open_reader(open_stream(iuv_path), order)
    if video.frame_count != reader.stream.frame_count:
        raise InputError(
            f"it has {video.frame_count} frames, but {iuv_path.name} has"
            f" {reader.stream.frame_count}"
        )
    return Clip(path.stem, video, reader)
