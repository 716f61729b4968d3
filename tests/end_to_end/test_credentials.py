"""Content Credentials: outputs signed by certificates made here, read back by C2PA's reader."""

from __future__ import annotations

import datetime
import json
from pathlib import Path

import pytest

pytest.importorskip("c2pa", reason="needs the `c2pa` extra")
from c2pa import Reader
from cryptography import x509
from cryptography.hazmat.primitives import hashes
from cryptography.hazmat.primitives.asymmetric import ec, ed25519
from cryptography.hazmat.primitives.serialization import (
    BestAvailableEncryption,
    Encoding,
    NoEncryption,
    PrivateFormat,
)
from cryptography.x509.oid import ExtendedKeyUsageOID, NameOID

from motion_transfer.media.credentials import RECORD_LABEL

AFTER, BEFORE = datetime.datetime(2020, 1, 1), datetime.datetime(2060, 1, 1)


def _name(words: str) -> x509.Name:
    return x509.Name(
        [
            x509.NameAttribute(NameOID.COMMON_NAME, words),
            x509.NameAttribute(NameOID.ORGANIZATION_NAME, "Tests"),
        ]
    )


def _certificate(subject: str, key, issuer: str, issuer_key, *, is_issuer: bool):
    uses = {
        "digital_signature": not is_issuer,
        "key_cert_sign": is_issuer,
        "crl_sign": is_issuer,
        **dict.fromkeys(
            [
                *("content_commitment", "key_encipherment", "data_encipherment"),
                *("key_agreement", "encipher_only", "decipher_only"),
            ],
            False,
        ),
    }
    builder = (
        x509.CertificateBuilder()
        .subject_name(_name(subject))
        .issuer_name(_name(issuer))
        .public_key(key.public_key())
        .serial_number(x509.random_serial_number())
        .not_valid_before(AFTER)
        .not_valid_after(BEFORE)
        .add_extension(x509.BasicConstraints(ca=is_issuer, path_length=None), critical=True)
        .add_extension(x509.KeyUsage(**uses), critical=True)
        .add_extension(x509.SubjectKeyIdentifier.from_public_key(key.public_key()), critical=False)
        .add_extension(
            x509.AuthorityKeyIdentifier.from_issuer_public_key(issuer_key.public_key()),
            critical=False,
        )
    )
    if not is_issuer:
        mail = x509.ExtendedKeyUsage([ExtendedKeyUsageOID.EMAIL_PROTECTION])
        builder = builder.add_extension(mail, critical=False)
    hashed = None if isinstance(issuer_key, ed25519.Ed25519PrivateKey) else hashes.SHA256()
    return builder.sign(issuer_key, hashed)


@pytest.fixture(scope="module", params=["P-256", "Ed25519"])
def chain(request, tmp_path_factory) -> tuple[str, Path, str, Path]:
    """The options that sign: a certificate with its issuer's, and its key."""

    def make_key():
        if request.param == "P-256":
            return ec.generate_private_key(ec.SECP256R1())
        return ed25519.Ed25519PrivateKey.generate()

    folder = tmp_path_factory.mktemp("keys")
    root, key = make_key(), make_key()
    issuer = _certificate("Root", root, "Root", root, is_issuer=True)
    own = _certificate("Signer", key, "Root", root, is_issuer=False)
    (folder / "cert.pem").write_bytes(b"".join(c.public_bytes(Encoding.PEM) for c in (own, issuer)))
    plain = key.private_bytes(Encoding.PEM, PrivateFormat.PKCS8, NoEncryption())
    (folder / "key.pem").write_bytes(plain)
    locked = BestAvailableEncryption(b"secret")
    (folder / "locked.pem").write_bytes(
        key.private_bytes(Encoding.PEM, PrivateFormat.PKCS8, locked)
    )
    return ("--credentials-cert", folder / "cert.pem", "--credentials-key", folder / "key.pem")


def faults(store: dict) -> set[str]:
    """What a validator finds wrong, but that nobody here trusts a certificate of the tests."""
    found = store["validation_results"]["activeManifest"]["failure"]
    return {fault["code"] for fault in found} - {"signingCredential.untrusted"}


@pytest.mark.parametrize(
    "name", ["out.mp4", "out.mov", "out.png", "out.gif", "out.webp", "out.apng"]
)
def test_signed_outputs_are_valid(studio, draft, mt, chain, name: str) -> None:
    output = studio.folder / name
    inputs = ("--source", studio.source(), "--driver", studio.array(3))
    few = ("--frames", "1") if name == "out.png" else ()
    made = draft(*inputs, "-o", output, *few, *chain)
    assert (made.code, made.err) == (0, "")
    kind = "image/png" if name == "out.apng" else None
    with output.open("rb") as stream:
        reader = Reader(kind or output.suffix[1:], stream)
        store = json.loads(reader.json())
    assert faults(store) == set()
    manifest = store["manifests"][store["active_manifest"]]
    assertions = {each["label"]: each["data"] for each in manifest["assertions"]}
    [action] = assertions["c2pa.actions.v2"]["actions"]
    assert action["action"] == "c2pa.created"
    assert action["digitalSourceType"].endswith("/compositeSynthetic")  # no network
    assert assertions[RECORD_LABEL]["sources"][0][0]["file"] == "person.png"
    assert [each["title"] for each in manifest["ingredients"]] == ["person.png"]
    assert "thumbnail" not in reader.json()
    assert not [item for item in output.parent.iterdir() if item.name.startswith(".")]
    assert mt("verify", output, *inputs).code == 0


def test_a_signed_output_that_is_edited_is_not_valid(studio, draft, chain) -> None:
    output = studio.folder / "out.mp4"
    draft(*("--source", studio.source(), "--driver", studio.array(3), "-o", output), *chain)
    data = bytearray(output.read_bytes())
    data[data.index(b"mdat") + 900] ^= 1
    output.write_bytes(data)
    with output.open("rb") as stream:
        assert faults(json.loads(Reader("video/mp4", stream).json()))


def test_what_cannot_be_signed_is_refused_before_anything_is_drawn(studio, draft, chain) -> None:
    run = ("--source", studio.source(), "--driver", studio.array(3), "-o")
    key, locked = chain[3], chain[3].with_name("locked.pem")
    for output, words, message in [
        ("out.mkv", chain, "out.mkv cannot hold Content Credentials; .mp4, .mov"),
        ("out", chain, "cannot hold Content Credentials"),
        ("out.mp4", chain[:2], "--credentials-cert and --credentials-key sign together"),
        ("out.mp4", (*chain[:3], locked), "has a password"),
        ("out.mp4", (*chain[:3], studio.source()), "is no private key in PEM"),
        ("out.mp4", (chain[0], key, *chain[2:]), f"certificate {key} is no PEM"),
    ]:
        made = draft(*run, studio.folder / output, *words)
        assert (made.code, made.err.count("\n")) == (2, 1), made.err
        assert message in made.err
        assert not (studio.folder / output).exists()
