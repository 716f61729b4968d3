"""How an option is described once, for the command line, for manifests and for the API."""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from functools import cache
from typing import Any, Literal

Kind = Literal["path", "text", "integer", "rate", "frames", "flag", "switch", "garments"]
Section = Literal["Source", "Driver", "Raw pictures", "Garment transfer", "Rendering", "Output"]


@dataclass(frozen=True)
class Option:
    """One option of a run.

    Attributes:
        name: the field of `RenderOptions`.
        flags: on the command line; the first long one, without dashes, is its word in a manifest.
        kind: what is written: a `switch` is yes, no or undecided, a `flag` is off unless given.
        choices: every allowed value, where there are few.
        metavar: what help shows in the value's place.
        in_manifest: whether a job may set it; `--workers` belongs to the whole batch.
    """

    name: str
    flags: tuple[str, ...]
    section: Section
    help: str
    kind: Kind
    default: Any
    required: bool
    choices: tuple[str, ...]
    metavar: str | None
    in_manifest: bool

    @property
    def word(self) -> str:
        """The option's name in a manifest, such as `source_iuv`."""
        if self.kind == "garments":
            return self.name
        long = next(flag for flag in self.flags if flag.startswith("--"))
        return long.split("/")[0].removeprefix("--").replace("-", "_")


REQUIRED: Any = object()


def option(
    flags: str,
    section: Section,
    help: str,
    *,
    kind: Kind = "text",
    default: Any = None,
    choices: tuple[str, ...] = (),
    metavar: str | None = None,
    in_manifest: bool = True,
) -> Any:
    """A dataclass field that carries its description; `flags` are separated by blanks."""
    words = {
        "flags": tuple(flags.split()),
        "section": section,
        "help": help,
        "kind": kind,
        "default": None if default is REQUIRED else default,
        "required": default is REQUIRED,
        "choices": choices,
        "metavar": metavar or "|".join(choices) or ("PATH" if kind == "path" else None),
        "in_manifest": in_manifest,
    }
    if default is REQUIRED:
        return field(metadata=words)
    return field(default=default, metadata=words)


@cache
def list_options(options_class: type) -> tuple[Option, ...]:
    """Every described field of a dataclass, in order."""
    return tuple(Option(name=entry.name, **entry.metadata) for entry in fields(options_class))
