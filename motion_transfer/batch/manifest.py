"""Manifests: what they may say, and the place of whatever is wrong in one.

The models follow from the options of a run, which are described once; so does the JSON Schema. A
file is YAML, TOML or JSON; all three mean the same.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    ValidationError,
    create_model,
)
from pydantic_core import ErrorDetails

from motion_transfer.errors import InputError, did_you_mean
from motion_transfer.media.structured import (
    parse_structured,
    read_stdin,
    read_structured,
    shown,
    shown_name,
)
from motion_transfer.option import Option, is_url, list_options
from motion_transfer.render.options import RenderOptions

MOST_ERRORS = 10  # a screenful: whoever mends those sees the next ones
Place = tuple[int | str, ...]
"""Where a field stands in a manifest, such as `("jobs", 0, "output")`."""

# a name such as `source: 7` is a number to YAML
STRICT = ConfigDict(extra="forbid", coerce_numbers_to_str=True)
PRIORITY = (int, Field(0, description="Jobs with a higher one are rendered first."))
NAME = (str | None, Field(None, description="What the report calls the job; else its output."))


class GarmentEntry(BaseModel):
    """Parts taken from another photo."""

    model_config = STRICT

    photo: str = Field(description="Photo that shows the garment.")
    parts: str = Field(description="Such as torso,upper-legs.")
    iuv: str | None = Field(None, description="Its IUV; else STEM_IUV.png beside it.")


class PartnerEntry(BaseModel):
    """Who takes the place of somebody else in the driver."""

    model_config = STRICT

    photo: str = Field(description="Photo of the person.")
    person: str = Field(description="Whose motion it is, as --driver-person.")
    iuv: str | None = Field(None, description="The photo's IUV; else STEM_IUV.png beside it.")


def _one_or_several(value: Any) -> Any:
    """Say in one line what pydantic says in one for each type of a union."""
    paths = value if isinstance(value, list) else [value]
    if not paths or not all(type(path) in (str, int, float) for path in paths):
        raise ValueError("write a path, or a list of paths")
    return value


Paths = Annotated[str | Annotated[list[str], Field(min_length=1)], BeforeValidator(_one_or_several)]


def _type_of(entry: Option) -> Any:
    if entry.choices:
        return Literal[entry.choices]
    kinds: dict[str, Any] = {
        "integer": int,
        "flag": bool,
        "switch": bool,
        "rate": str | float,
        "frames": str | int,
        "number": float,
        "garments": list[GarmentEntry],
        "partners": list[PartnerEntry],
        "paths": Paths,
    }
    return kinds.get(entry.kind, str)


def _checked(entry: Option) -> Any:
    def check(value: Any) -> Any:
        several = value if isinstance(value, list) else [value]
        try:
            if not any(map(is_url, several)):  # which are files when a job is laid out
                entry.read(plain(value))
        except InputError as error:
            raise ValueError(str(error)) from None  # of which pydantic makes a message
        return value

    return Annotated[_type_of(entry), AfterValidator(check)]


def plain(value: Any) -> Any:
    """Turn a field's value back into what was written: mappings, not models."""
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
SEVERAL = "A list within shows one person, all the matches of its globs."
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
        "source": (
            Paths,
            Field(description=f"As --source of `mt run`; a glob means each match. {SEVERAL}"),
        ),
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
        "sources": (
            list[Paths],
            Field(min_length=1, description=f"Photos; globs are allowed. {SEVERAL}"),
        ),
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
    """Make the JSON Schema of manifests, as published in `jobs/manifest.schema.json`."""
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "motion-transfer manifest",
        **Manifest.model_json_schema(),
    }


SETTABLE = [f for f in Manifest.model_fields if f not in ("version", "defaults", "jobs", "matrix")]
"""The manifest's own fields that `--set` may name; any other name is an option of its jobs."""


STDIN = Path("-")
STANDS_FOR_STDIN = Path("stdin.yaml")
"""The file, in the working directory, that standard input is as good as: paths are relative to its
folder, and journal and report are called after it."""


class ManifestError(InputError):
    """A manifest that cannot be used; the message has one line for each thing wrong."""


def read_manifest(path: Path, settings: Sequence[str] = ()) -> tuple[Manifest, ManifestText]:
    """Read and check a manifest.

    Args:
        settings: `key=value`, over a field of the manifest or an option of every job.
    Raises: ManifestError naming file, line where possible, field, value and what is allowed.
    """
    text = ManifestText(path)
    data = text.data
    if not isinstance(data, dict):
        raise ManifestError(f"{text.name}: a manifest is a mapping with version and jobs")
    given = {_set(data, setting): setting for setting in settings}
    try:
        return Manifest.model_validate(data), text
    except ValidationError as error:
        raise text.error(error.errors(), given) from None


class ManifestText:
    """A manifest as it was written, which can say where a field stands."""

    def __init__(self, path: Path) -> None:
        """Read the file, or standard input for `STDIN`.

        Raises: ManifestError if it cannot be, naming the line where possible.
        """
        self.path = STANDS_FOR_STDIN if path == STDIN else path
        self._name = "standard input" if path == STDIN else str(path)
        try:
            if path == STDIN:  # JSON is YAML, too
                self._content = parse_structured(read_stdin("manifest"), ".yaml", self._name)
            else:
                self._content = read_structured(path, "manifest")
        except InputError as error:
            raise ManifestError(str(error)) from None

    @property
    def name(self) -> str:
        """What messages call it."""
        return self._name

    @property
    def data(self) -> Any:
        """What it says."""
        return self._content.data

    def where(self, place: Place) -> str:
        """Name file, line where possible, and field, for messages."""
        line = self._content.line(place)
        words = "".join(f"[{s}]" if isinstance(s, int) else f".{shown_name(s)}" for s in place)
        return f"{self._name}{f':{line}' if line else ''}: {words.lstrip('.')}"

    def error(self, details: Sequence[ErrorDetails], given: Mapping[str, str]) -> ManifestError:
        """Say everything that is wrong, a line each.

        Args:
            given: The `key=value` settings by key: what is wrong there stands in no file.
        """
        lines: dict[str, None] = {}  # an ordered set: one wrong default is wrong in every job
        for number, detail in enumerate(details):
            if len(lines) == MOST_ERRORS:
                lines[f"and {len(details) - number} more"] = None
                break
            setting = next((given[s] for s in map(str, detail["loc"]) if s in given), None)
            if setting is None:
                lines[self._sentence(detail)] = None
            else:
                lines[f"--set {setting}: {_reason(detail)}"] = None
        return ManifestError(*lines)

    def _sentence(self, detail: ErrorDetails) -> str:
        place = detail["loc"]
        value, kind = detail["input"], detail["type"]
        if kind == "extra_forbidden":
            return f"{self.where(place)}: {_unknown(str(list(place)[-1]), _known_fields(place))}"
        if kind == "missing":
            return f"{self.where(place)}: is missing"
        return f"{self.where(place)}: {shown(value)}: {_reason(detail)}"


def _known_fields(place: Place) -> list[str]:
    """List the fields of the model in which a field stands."""
    model: Any = Manifest
    for step in list(place)[:-1]:
        if isinstance(step, str) and step in model.model_fields:
            model = model.model_fields[step].annotation
            while inner := getattr(model, "__args__", None):  # such as list[Job]
                model = inner[0]
    return list(getattr(model, "model_fields", Manifest.model_fields))


def _unknown(name: str, known: Sequence[str]) -> str:
    hint = did_you_mean(name, known) or ";"
    return f"unknown field{hint} allowed are {', '.join(known)}"


def _reason(detail: ErrorDetails) -> str:
    return detail["msg"].removeprefix("Value error, ")  # pydantic's, before a message of ours


def _set(data: dict[str, Any], setting: str) -> str:
    """Apply `key=value` to the manifest if it has such a field, else to all jobs; give the key.

    Raises: ManifestError for a key that is neither.
    """
    key, equals, value = setting.partition("=")
    if not equals:
        raise ManifestError(f"--set {setting!r}; write key=value")
    try:
        parsed = parse_structured(value, ".yaml", "--set").data
    except InputError:
        parsed = value
    if parsed is None and value.strip() not in ("", "~", "null"):
        parsed = value  # such as #102030, which YAML takes for a comment
    if key in SETTABLE:
        data[key] = parsed
        return key
    if key not in Defaults.model_fields:
        known = [*SETTABLE, *Defaults.model_fields]
        raise ManifestError(f"--set {setting}: {_unknown(key, known)}")
    data["defaults"] = {**(data.get("defaults") or {}), key: parsed}
    for entry in [*(data.get("jobs") or []), *(data.get("matrix") or [])]:
        if isinstance(entry, dict) and key in entry:
            entry[key] = parsed
    return key
