"""What a number depends on, so that two are only compared when they may be."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields
from importlib.metadata import PackageNotFoundError, version
from typing import Any

from motion_transfer.errors import InputError


@dataclass(frozen=True, kw_only=True)
class Protocol:
    """How numbers were measured. Where two have `differences`, their numbers are not compared.

    Attributes:
        resolution: WIDTHxHEIGHT in px.
        resize_filter, padding, background, mask: see `motion_transfer.evaluation.framing`.
        pairs_name: for people; the same pairs may go by another name.
        pairs_count, pairs_sha256: of what was scored: names, order and pixels.
        metrics: each number's definition, with the SHA-256 of the weights behind it.
        packages: MAJOR.MINOR of the libraries that resize pictures and compute numbers.
    """

    resolution: str
    resize_filter: str
    padding: str
    background: str
    mask: str
    pairs_name: str = field(compare=False)
    pairs_count: int
    pairs_sha256: str
    metrics: Mapping[str, str]
    packages: Mapping[str, str]

    def __hash__(self) -> int:
        return hash((self.resolution, self.pairs_sha256))

    def differences(self, other: Protocol) -> list[str]:
        """Why numbers of the two may not be compared, a line for each field; empty if they may.

        A number that only one of them has is no difference.
        """
        lines = []
        for name in (item.name for item in fields(self) if item.compare):
            ours, theirs = getattr(self, name), getattr(other, name)
            if isinstance(ours, Mapping):
                lines += [
                    f"{name}.{key}: {ours[key]} / {theirs[key]}"
                    for key in ours
                    if key in theirs and ours[key] != theirs[key]
                ]
            elif ours != theirs:
                lines.append(f"{name}: {ours} / {theirs}")
        return lines

    def to_dict(self) -> dict[str, Any]:
        """Plain values, ready for JSON."""
        return asdict(self)

    @classmethod
    def from_dict(cls, values: Mapping[str, Any]) -> Protocol:
        """The inverse of `to_dict`. Raises: InputError if fields are missing or unknown."""
        names = {item.name for item in fields(cls)}
        wrong = sorted(names ^ set(values))
        if wrong:
            raise InputError(f"the protocol lacks, or should not have, {', '.join(wrong)}")
        if not all(isinstance(values[name], Mapping) for name in ("metrics", "packages")):
            raise InputError("the protocol's metrics and packages are not tables")
        return cls(**values)


def package_versions(names: tuple[str, ...]) -> dict[str, str]:
    """MAJOR.MINOR of installed packages; patch releases do not change what they compute."""
    found = {}
    for name in names:
        try:
            found[name] = ".".join(version(name).split(".")[:2])
        except PackageNotFoundError:
            found[name] = "unknown"
    return found
