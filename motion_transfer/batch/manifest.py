"""What a manifest may say: models derived from the options of a run, and their JSON Schema."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, create_model

from motion_transfer.errors import InputError
from motion_transfer.render.option import Option, list_options
from motion_transfer.render.options import RenderOptions, parse_word

VERSION = 1
STRICT = ConfigDict(extra="forbid", coerce_numbers_to_str=True)
PRIORITY = (int, Field(0, description="Jobs with a higher one are rendered first."))
NAME = (str | None, Field(None, description="What the report calls the job; else its output."))


class GarmentEntry(BaseModel):
    """Parts taken from another photo."""

    model_config = STRICT

    photo: str = Field(description="Photo that shows the garment.")
    parts: str = Field(description="Such as torso,upper-legs.")
    iuv: str | None = Field(None, description="Its IUV; else STEM_IUV.png beside it.")


def _type_of(entry: Option) -> Any:
    if entry.choices:
        return Literal[entry.choices]
    kinds: dict[str, Any] = {
        "integer": int,
        "flag": bool,
        "switch": bool,
        "rate": str | float,
        "frames": str | int,
        "garments": list[GarmentEntry],
    }
    return kinds.get(entry.kind, str)


def _checked(entry: Option) -> Any:
    def check(value: Any) -> Any:
        try:
            parse_word(entry, plain(value))
        except InputError as error:
            raise ValueError(str(error)) from None
        return value

    return Annotated[_type_of(entry), AfterValidator(check)]


def plain(value: Any) -> Any:
    """A model's value as the mapping it came from."""
    if isinstance(value, list):
        return [item.model_dump() if isinstance(item, BaseModel) else item for item in value]
    return value


def _fields(*, leave_out: tuple[str, ...] = ()) -> dict[str, Any]:
    return {
        entry.word: (_checked(entry) | None, Field(None, description=entry.help))
        for entry in list_options(RenderOptions)
        if entry.in_manifest and entry.name not in leave_out
    }


def _required(description: str) -> Any:
    return (str, Field(description=description))


PLACEHOLDERS = "{source}, {driver}: names without their endings; {index}: counts from 1"
OUTPUT = _required(f"Below the output root. With globs, a template of {PLACEHOLDERS}.")

Defaults = create_model(
    "Defaults", __config__=STRICT, __doc__="Options of every job.", **_fields(leave_out=("output",))
)
JobEntry = create_model(
    "Job",
    __config__=STRICT,
    __doc__="One run, or one for each match of a glob.",
    **{
        **_fields(),
        "source": _required("Photo of the person; a glob means each match."),
        "driver": _required("As --driver of `mt run`; a glob means each match."),
        "output": OUTPUT,
        "priority": PRIORITY,
        "name": NAME,
    },
)
MatrixEntry = create_model(
    "Matrix",
    __config__=STRICT,
    __doc__="Every source with every driver.",
    **{
        **_fields(leave_out=("source", "driver")),
        "sources": (list[str], Field(min_length=1, description="Photos; globs are allowed.")),
        "drivers": (list[str], Field(min_length=1, description="Drivers; globs are allowed.")),
        "output": OUTPUT,
        "priority": PRIORITY,
    },
)


class Manifest(BaseModel):
    """Many runs of motion-transfer. Paths are relative to the manifest's folder."""

    model_config = STRICT

    version: Literal[1] = Field(description="Of this format.")
    output_root: str = Field(".", description="Outputs lie below this folder.")
    outside_outputs: bool = Field(
        False, description="Allow absolute outputs, `..` and links that leave the root."
    )
    retries: int = Field(
        1, ge=0, le=10, description="How often a chunk that failed is tried again."
    )
    defaults: Defaults = Field(default_factory=Defaults)  # pyright: ignore[reportInvalidTypeForm]
    jobs: list[JobEntry] = Field(default_factory=list)  # pyright: ignore[reportInvalidTypeForm]
    matrix: list[MatrixEntry] = Field(default_factory=list)  # pyright: ignore[reportInvalidTypeForm]


def schema() -> dict[str, Any]:
    """The JSON Schema of manifests, as published in `jobs/manifest.schema.json`."""
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "motion-transfer manifest",
        **Manifest.model_json_schema(),
    }
