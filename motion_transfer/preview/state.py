"""What the page is told, whole, whenever something changes."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from motion_transfer.preview.words import command_line
from motion_transfer.render.options import DEFAULT_RATE, RENDERERS, parse_window
from motion_transfer.render.prepare import frame_size
from motion_transfer.render.recipe import Recipe

if TYPE_CHECKING:
    from motion_transfer.preview.session import Session

MOST_BROKEN = 1000  # messages; a driver with more has other problems


def describe(session: Session, work: dict[str, Any] | None, notices: list[str]) -> dict[str, Any]:
    """The state of a session, for JSON."""
    options, look, plans = session.options, session.look, session.plans
    window = parse_window(options.window)
    rate = options.frame_rate or (look and look.frame_rate) or DEFAULT_RATE
    chosen = plans.chosen if plans else range(0)
    return {
        "revision": session.revision,
        "key": session.key,
        "options": {
            "renderer": options.renderer,
            "background": options.background,
            "person": options.person,
            "driver_person": options.driver_person,
            "frames": [chosen.start, chosen.stop],
            "frame_rate": str(rate),
            "window": dict(zip(("x", "y", "side"), window, strict=True)) if window else None,
        },
        "choices": {
            "renderer": list(RENDERERS),
            "person": _with(["largest", *map(str, range(session.source_people))], options.person),
            "driver_person": _with(
                ["largest", *map(str, range(_people_in_driver(session)))], options.driver_person
            ),
        },
        "source": _source(session),
        "driver": _driver(session),
        "work": work,
        "planned": plans is not None and plans.exact,
        "shots": [
            {
                "start": shot.start,
                "stop": shot.stop,
                "x": shot.window.x,
                "y": shot.window.y,
                "side": shot.window.side,
            }
            for shot in (plans.shots if plans else ())
        ],
        "size": _output_size(session),
        "broken": dict(sorted(dict(look.broken).items())[:MOST_BROKEN]) if look else {},
        "missing": plans.missing if plans else [],
        "notices": notices,
        "error": session.error,
        "render": {**session.rendering.state(), "output": str(session.options.output)},
        "command": command_line(options),
        "job_file": str(session.job_file),
        "output": str(options.output),
    }


def _driver(session: Session) -> dict[str, Any] | None:
    look = session.look
    if look is None:
        return None
    return {
        "name": look.path.name,
        "frame_count": look.frame_count,
        "width": look.reader.width,
        "height": look.reader.height,
        "frame_rate": str(look.frame_rate or DEFAULT_RATE),
        "pictures": session.has_pictures,
    }


def _source(session: Session) -> dict[str, Any] | None:
    if session.source is None:
        return None
    height, width = session.source.photo.rgb.shape[:2]
    return {"name": session.options.source.name, "width": width, "height": height}


def _output_size(session: Session) -> dict[str, int] | None:
    options, look, plans = session.options, session.look, session.plans
    if look is None or plans is None:
        return None
    crop = 0
    if options.size == "crop":
        recipe = Recipe(options.renderer, options.weights_file)
        crop = recipe.working_size(max(shot.window.side for shot in plans.shots))
    height, width = frame_size(options, look.reader.height, look.reader.width, crop)
    return {"width": width, "height": height}


def _people_in_driver(session: Session) -> int:
    look = session.look
    if look is None or look.pictures is not None:
        return 0
    return look.most_people


def _with(listed: list[str], current: str) -> list[str]:
    return listed if current in listed else [*listed, current]
