"""Writing a motion down as a driver: a folder of IUV images, or a lossless video."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from motion_transfer.errors import OutputError
from motion_transfer.media.formats import choose_format
from motion_transfer.media.image import write_png
from motion_transfer.media.publish import check_destination, publish, work_folder
from motion_transfer.media.segments import open_segment
from motion_transfer.people.driver import MotionDriver, MotionOptions


def check_driver_name(output: Path) -> None:
    """Raises: OutputError for a name that is neither a folder's nor a Matroska video's."""
    if output.suffix.lower() not in ("", ".mkv"):
        raise OutputError(
            f"cannot write {output}: a driver is a folder of PNG (no ending) or a lossless .mkv"
        )


def record_motion(
    options: MotionOptions,
    output: Path,
    *,
    force: bool = False,
    done: Callable[[int], object] = int,
) -> MotionDriver:
    """Write a driver. Colours of the files are V, U, I, as those of Caffe2's DensePose.

    Args:
        done: called after each frame.
    Raises: InputError and its kinds, before any work where it can be known; nothing half-written
        stays behind.
    """
    check_driver_name(output)
    check_destination(output, force=force)
    driver = MotionDriver(options)
    with work_folder(output) as folder:
        finished = folder / f"finished{output.suffix.lower()}"
        if output.suffix:
            video = choose_format(output, codec="ffv1", crf=None)
            with open_segment(
                finished, video, size=options.size, rate=options.frame_rate, first=0
            ) as segment:
                for index in range(driver.frame_count):
                    segment.write(driver.iuv(index)[..., ::-1].copy())
                    done(1)
        else:
            finished.mkdir()
            for index in range(driver.frame_count):
                write_png(finished / f"{index:06d}.png", driver.iuv(index)[..., ::-1])
                done(1)
        publish(finished, output)
    return driver
