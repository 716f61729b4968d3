"""Content Credentials: an output signed by a certificate of the user's own, as C2PA has it.

What is signed is that a program drew it, the IPTC's source type, and the output's record. Nothing
is asked of the network: the signature has no time stamp of an authority.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from motion_transfer.errors import InputError, OutputError, first_line
from motion_transfer.extras import require_extra
from motion_transfer.media.files import read_bytes
from motion_transfer.version import __version__

if TYPE_CHECKING:
    from cryptography.hazmat.primitives.asymmetric.types import PrivateKeyTypes

SIGNED = {
    ".mp4": "video/mp4",
    ".mov": "video/quicktime",
    ".png": "image/png",
    ".apng": "image/png",
    ".gif": "image/gif",
    ".webp": "image/webp",
}
"""Endings of files that can hold credentials, and their MIME types."""

INGREDIENTS = SIGNED | {".jpg": "image/jpeg", ".jpeg": "image/jpeg", ".heic": "image/heic"}
RECORD_LABEL = "org.motion-transfer.provenance"
CURVES = {"secp256r1": "es256", "secp384r1": "es384", "secp521r1": "es512"}
QUIET = {"builder": {"thumbnail": {"enabled": False}}}
"""Settings of the library: no small picture of anybody goes into the credentials."""


def check_credentials(output: Path, certificate: Path, key: Path) -> None:
    """Refuse what cannot be signed, before anything is drawn.

    Raises: InputError for a certificate or a key that cannot be used, or where the package that
        signs is missing; OutputError for an output that holds no credentials.
    """
    if output.suffix.lower() not in SIGNED:
        raise OutputError(
            f"{output} cannot hold Content Credentials; {', '.join(SIGNED)} can; or leave out"
            " --credentials-cert"
        )
    require_extra("c2pa")
    from cryptography.hazmat.primitives.serialization import Encoding, PublicFormat
    from cryptography.x509 import load_pem_x509_certificates

    try:
        chain = load_pem_x509_certificates(read_bytes(certificate, "certificate"))
    except ValueError as error:
        raise InputError(f"certificate {certificate} is no PEM: {first_line(error)}") from error
    private = _read_key(key)
    form = Encoding.DER, PublicFormat.SubjectPublicKeyInfo
    if private.public_key().public_bytes(*form) != chain[0].public_key().public_bytes(*form):
        raise InputError(f"key {key} does not belong to the first certificate of {certificate}")
    _find_algorithm(private, key)


def sign(
    finished: Path,
    signed: Path,
    *,
    title: str,
    source_type: str,
    record: str | None,
    ingredients: Sequence[Path],
    certificate: Path,
    key: Path,
) -> None:
    """Write a signed copy of a finished file.

    Args:
        source_type: The address of the IPTC's term.
        record: JSON; None: it is not told.
        ingredients: What it was made of; those in formats without credentials are left out.
    Raises: InputError if the certificate is none to sign with.
    """
    from c2pa import Builder, C2paError, C2paSignerInfo, Context, Signer

    kind = SIGNED[finished.suffix.lower()]
    created = {"action": "c2pa.created", "digitalSourceType": source_type}
    assertions: list[dict[str, Any]] = [
        {"label": "c2pa.actions.v2", "data": {"actions": [created]}}
    ]
    if record is not None:
        assertions.append({"label": RECORD_LABEL, "data": json.loads(record)})
    manifest = {
        "claim_generator_info": [{"name": "motion-transfer", "version": __version__}],
        "title": title,
        "format": kind,
        "assertions": assertions,
    }
    algorithm = _find_algorithm(_read_key(key), key)
    own, private = (read_bytes(path, "credentials") for path in (certificate, key))
    try:
        with (
            Context.from_dict(QUIET) as context,
            Signer.from_info(C2paSignerInfo(algorithm, own, private, None)) as signer,
            Builder(json.dumps(manifest), context=context) as builder,
        ):
            for path in ingredients:
                if (form := INGREDIENTS.get(path.suffix.lower())) and path.is_file():
                    told = json.dumps({"title": path.name, "relationship": "inputTo"})
                    with path.open("rb") as stream:
                        builder.add_ingredient(told, form, stream)
            with finished.open("rb") as source, signed.open("w+b") as target:
                builder.sign(signer, kind, source, target)
    except C2paError as error:
        raise InputError(
            f"certificate {certificate} cannot sign: {first_line(error)}; it needs the uses that"
            " C2PA asks for, and those of its issuers below it"
        ) from error


def _read_key(key: Path) -> PrivateKeyTypes:
    from cryptography.hazmat.primitives.serialization import load_pem_private_key

    try:
        return load_pem_private_key(read_bytes(key, "key"), None)
    except TypeError:
        raise InputError(f"key {key} has a password; write it without, by openssl pkey") from None
    except ValueError as error:
        raise InputError(f"key {key} is no private key in PEM: {first_line(error)}") from error


def _find_algorithm(private: PrivateKeyTypes, key: Path) -> str:
    """Tell the algorithm of a key in C2PA's words. Raises: InputError if it has none for it."""
    from cryptography.hazmat.primitives.asymmetric import ec, ed25519, rsa

    match private:
        case ec.EllipticCurvePrivateKey() if private.curve.name in CURVES:
            return CURVES[private.curve.name]
        case ed25519.Ed25519PrivateKey():
            return "ed25519"
        case rsa.RSAPrivateKey():
            return "ps256"
    raise InputError(f"key {key} is of a kind that C2PA does not know; take P-256, Ed25519 or RSA")
