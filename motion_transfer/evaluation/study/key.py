"""What stays with whoever makes a study: which method is behind each view."""

from __future__ import annotations

from pathlib import Path
from typing import Literal, TypeVar

from pydantic import BaseModel, ConfigDict, ValidationError

from motion_transfer.errors import InputError
from motion_transfer.media.structured import parse_json, read_text

PAGE_FOLDER, KEY_FILE, ANSWERS_FOLDER, RESULTS_FOLDER = "page", "key.json", "answers", "results"
KEY_FORMAT = "mt-study-key-1"
QUESTIONS = {
    "realism": "Which looks more realistic?",
    "identity": ("Which keeps the identity and clothes of the person in the source photo better?"),
}
"""The paper's two; the second only where sources are shown."""

Side = Literal["left", "right"]
View = Literal["a", "b"]
Form = TypeVar("Form", bound=BaseModel)


class Strict(BaseModel):
    """Takes what is described, of the type described, and nothing else."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)


class Comparison(Strict):
    """Two methods' views of one item: labels."""

    item: str
    a: str
    b: str


class Key(Strict):
    """A study: its comparisons by their blind names.

    Attributes:
        pairs: (label, label) of the methods that are compared, as results name them.
        asked, repeats: How many comparisons a reader is shown, and how many once more.
        files: What lies behind each file of the page, in words.
    """

    format: Literal["mt-study-key-1"] = KEY_FORMAT
    study: str
    pairs: list[list[str]]
    questions: list[str]
    asked: int
    repeats: int
    comparisons: dict[str, Comparison]
    files: dict[str, str]


def read_key(path: Path) -> Key:
    """Read a study's key. Raises: InputError if it is none."""
    return read_form(
        Key, parse_json(read_text(path, "key"), str(path)), f"{path} is no study's key"
    )


def read_form(form: type[Form], data: object, problem: str) -> Form:
    """Check data against a model. Raises: InputError with the problem and the first reason."""
    try:
        return form.model_validate(data)
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(map(str, first["loc"]))
        raise InputError(f"{problem}: {where or 'it'}: {first['msg'].lower()}") from None
