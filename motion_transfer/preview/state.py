"""Everything that the page shows, in words and numbers, for JSON."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import asdict
from pathlib import Path
from typing import Any

from motion_transfer.drawing.renderers import RENDERERS
from motion_transfer.drawing.window import Window
from motion_transfer.errors import OutputError
from motion_transfer.media.codecs import CODECS
from motion_transfer.media.output.formats import CONTAINERS, OUTPUT_KINDS
from motion_transfer.preview.changes import FORMATS, SHOWN_AS_IS
from motion_transfer.preview.dropped import MOST_BYTES, MOST_FILE_BYTES
from motion_transfer.preview.export import command_line
from motion_transfer.preview.session import Session
from motion_transfer.render.composition import read_format
from motion_transfer.render.options import DEFAULT_RATE, LEGS, SIZES, RenderOptions, parse_window
from motion_transfer.render.scene import frame_size
from nhrr_core.parts import PART_GROUPS

MOST_BROKEN = 1000  # messages that are sent; a driver with more has other problems


def describe(session: Session) -> dict[str, Any]:
    """Describe a session as it stands."""
    with session.lock:
        return {
            "revision": session.revision,
            "key": session.key,
            **_choices(session),
            **_people(session),
            **_motion(session),
            **_frames(session),
            **_outputs(session),
            "notices": _notices(session),
            "error": session.error,
            "folder": _short(session.folder),
            "limits": {"file": MOST_FILE_BYTES, "all": MOST_BYTES, "used": session.dropped.bytes},
        }


def _choices(session: Session) -> dict[str, Any]:
    options, opening, plans = session.options, session.opening, session.plans
    driver = opening.driver
    window, behind = parse_window(options.window), options.background_file
    rate = options.frame_rate or (driver and driver.opened.frame_rate) or DEFAULT_RATE
    # of raw pictures one person is left
    in_driver = driver.most_people if driver and not driver.opened.pictures else 0
    shown = {name: getattr(options, name) for name in SHOWN_AS_IS}
    return {
        "options": {
            **{name: str(v) if isinstance(v, Path) else v for name, v in shown.items()},
            "frames": [plans.chosen.start, plans.chosen.stop] if plans else [0, 0],
            "frame_rate": str(rate),
            "window": asdict(Window(*window)) if window else None,
        },
        "choices": {
            "renderer": list(RENDERERS),
            "person": _whom(session.source_people, options.person),
            "unseen_legs": list(LEGS),
            "driver_person": _whom(in_driver, options.driver_person),
            "size": [each for each in SIZES if each != "background" or behind],
            "parts": list(PART_GROUPS),
        },
        "backgrounds": [
            {"value": value, "name": Path(value).name} for value in session.backgrounds()
        ],
    }


def _people(session: Session) -> dict[str, Any]:
    options, photos, source = session.options, session.choices.photos, session.source
    names = [photos[number].name for number in session.numbers]
    garments = zip(session.garments, options.garments, strict=True)
    return {
        "sources": [{"number": n, "name": photos[n].name} for n in session.numbers],
        "examples": [{"number": n, "name": photos[n].name} for n in session.choices.examples],
        "garments": [
            {"number": n, "name": photos[n].name, "parts": _groups(garment.parts)}
            for n, garment in garments
        ],
        "source_work": session.source_work and session.source_work.told(),
        "source": source
        and {
            "name": _name_some(names),
            "width": source.photo.rgb.shape[1],
            "height": source.photo.rgb.shape[0],
        },
    }


def _motion(session: Session) -> dict[str, Any]:
    driver, opening, motions = session.driver, session.opening, session.choices.motions
    return {
        "motions": [{"number": n, "name": each.name} for n, each in enumerate(motions)],
        "motion": session.motion,
        "azimuth": session.azimuth,
        "can_turn": session.can_turn,
        "driver": driver
        and {
            "name": motions[session.motion].name,
            "frame_count": driver.opened.frame_count,
            "width": driver.opened.reader.width,
            "height": driver.opened.reader.height,
            "frame_rate": str(driver.opened.frame_rate or DEFAULT_RATE),
            "pictures": opening.proxies is not None,
        },
        "work": opening.work and opening.work.told(),
    }


def _frames(session: Session) -> dict[str, Any]:
    driver, plans = session.driver, session.plans
    broken = dict(driver.broken) if driver else {}  # a copy: others are writing to it
    shots = plans.shots if plans else ()
    return {
        "planned": plans is not None and plans.exact,
        "shots": [{"start": s.start, "stop": s.stop, **asdict(s.window)} for s in shots],
        "size": _output_size(session),
        "broken": dict(sorted(broken.items())[:MOST_BROKEN]),
        "missing": plans.missing if plans else [],
    }


def _outputs(session: Session) -> dict[str, Any]:
    options, output = session.options, session.options.output
    return {
        "output": {
            "path": str(output),
            "folder": _short(output.absolute().parent),
            "name": output.stem,
            "format": output.suffix.lower(),
            "formats": [each for each in FORMATS if each != ".png"],
            **_quality(options, _output_size(session)),
        },
        "renders": [render.told() for render in session.renders.all],
        "command": "" if session.is_empty else command_line(options),
        "job_file": str(session.job_file),
    }


def _quality(options: RenderOptions, size: dict[str, int] | None) -> dict[str, Any]:
    """Tell what a format can have: sound, and a quality, from the usual one to the worst."""
    suffix = options.output.suffix.lower()
    kind = next((row for row in OUTPUT_KINDS.values() if suffix in row.suffixes), None)
    codec, fault = None, ""
    try:
        codec = CODECS[read_format(options).codec_name] if suffix in CONTAINERS else None
    except OutputError as error:
        fault = str(error)
    odd = bool(size) and (size["height"] % 2 or (size["width"] % 2 and not options.compare))
    if codec and codec.needs_even_size and odd:
        fault = f"{suffix} needs even sides; choose the frame size “as the driver, even”"
    return {
        "fault": fault,
        "has_sound": bool(kind and kind.has_sound),
        "crf": codec and codec.crf,
        "highest_crf": codec and codec.highest_crf,
    }


def _notices(session: Session) -> list[str]:
    notes = session.source.notes if session.source else ()
    return list(dict.fromkeys([*session.opening.notices, *notes]))


def _output_size(session: Session) -> dict[str, int] | None:
    options, driver, plans = session.options, session.driver, session.plans
    if driver is None or plans is None:
        return None
    crop = 0
    if options.size == "crop":
        crop = session.views.working_size(options, plans.largest_side)
    reader = driver.opened.reader
    height, width = frame_size(options, reader.height, reader.width, crop)
    return {"width": width, "height": height}


def _groups(parts: tuple[int, ...]) -> list[str]:
    """Name parts by their groups, where those are whole."""
    return [name for name, group in PART_GROUPS.items() if set(group) <= set(parts)]


def _name_some(names: list[str]) -> str:
    """Name one or two, and count more."""
    return ", ".join(names) if len(names) < 3 else f"{names[0]} and {len(names) - 1} more"


def _short(folder: Path) -> str:
    """Write a folder as people write it: from the home folder on, where it lies in there."""
    with suppress(RuntimeError, ValueError):  # there is no such folder, or it lies elsewhere
        return str("~" / folder.relative_to(Path.home()))
    return str(folder)


def _whom(count: int, current: str) -> list[str]:
    """List whom one can choose: the largest, each of some people, and the present choice."""
    return list(dict.fromkeys(["largest", *map(str, range(count)), current]))
