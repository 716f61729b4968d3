"""One frame without a browser."""

from __future__ import annotations

import threading
from pathlib import Path

from motion_transfer.errors import InputError, OutputError
from motion_transfer.media.image import write_png
from motion_transfer.media.publish import check_destination, publish, work_folder
from motion_transfer.preview.driver_look import open_look
from motion_transfer.preview.frame_plans import plan_frames
from motion_transfer.preview.pictures import Pictures
from motion_transfer.render.events import ignore
from motion_transfer.render.options import RenderOptions


def write_frame(options: RenderOptions, index: int, output: Path) -> None:
    """Write a frame of the driver as the whole run would draw it, its crop window included.

    Raises: InputError if there is no such frame; OutputError if the file cannot be written.
    """
    if output.suffix.lower() != ".png":
        raise OutputError(f"{output} is no .png; one frame is written as PNG")
    check_destination(output, force=options.force)
    with work_folder(output) as folder:
        look = open_look(options, folder, ignore)
        if not 0 <= index < look.frame_count:
            raise InputError(
                f"frame {index} asked for, but {options.driver} has {look.frame_count}: 0 to"
                f" {look.frame_count - 1}"
            )
        look.look_through(threading.Event(), lambda _count: None)
        if index in look.broken:
            raise InputError(look.broken[index])
        picture = Pictures().result(options, look, plan_frames(look, options), index)
        write_png(folder / "frame.png", picture)
        publish(folder / "frame.png", output)
