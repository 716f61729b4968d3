"""What is done to valid files: as bytes, as text, and inside their envelopes.

A reader that checks a checksum first sees nothing else of a file that was changed anywhere: PNG,
ZIP and the like are therefore opened, changed inside, and sealed again.
"""

from __future__ import annotations

import io
import json
import re
import struct
import zipfile
import zlib

from hypothesis import strategies as st

MOST_CHANGES = 5

NUMBERS = (
    *(0, 1, 2, 0x7F, 0x80, 0xFF, 0x7FFF, 0x8000, 0xFFFF, 60_000, 1_000_000),
    *(2**31 - 1, 2**31, 2**32 - 1, 2**40, 2**63 - 1, 2**64 - 1),
)
WORDS = (
    *("", "0", "-1", "1e400", "-1e30", "nan", "inf", "null", "true", "~", "0x1F", "1_0", "-0.0"),
    *("9" * 400, "9" * 5000, "³", "٣", "½", "\x00", "\x1b", "\ufeff", "\ud7ff", "é" * 200),
    *(
        "[" * 50,
        "[" * 5000,
        "{" * 5000,
        "]",
        "}",
        "{",
        '"',
        "'",
        ",",
        ":",
        "\t",
        "\r",
        "#",
        "&a",
        "*a",
    ),
    *("<<: *a", "!!python/name:os.system", "!!binary x", "!!set {a}", "2001-13-40", "? a", "- - -"),
    *(
        "..",
        "/",
        "/dev/zero",
        "*",
        "{source}",
        "{index:>9999999}",
        "a" * 300,
        "END",
        "ROOT",
        "MOTION",
    ),
)
TOKEN = re.compile(r"[\w.+-]+|\S")


@st.composite
def bytes_of(draw: st.DrawFn, data: bytes) -> bytes:
    """Cut, flip, repeat, and put numbers of all widths where others stood."""
    changed = bytearray(data)
    for _ in range(draw(st.integers(1, MOST_CHANGES))):
        at = draw(st.integers(0, max(0, len(changed) - 1)))
        match draw(st.sampled_from(["byte", "number", "cut", "delete", "repeat", "insert"])):
            case "byte":
                changed[at : at + 1] = bytes([draw(st.integers(0, 255))])
            case "number":
                width = draw(st.sampled_from([1, 2, 4, 8]))
                number = draw(st.sampled_from(NUMBERS)) % (1 << 8 * width)
                packed = number.to_bytes(width, "big")
                changed[at : at + width] = packed if draw(st.booleans()) else packed[::-1]
            case "cut":
                del changed[at:]
            case "delete":
                del changed[at : at + draw(st.integers(1, 64))]
            case "repeat":
                piece = changed[at : at + draw(st.integers(1, 64))]
                changed[at:at] = piece * draw(st.integers(1, 20))
            case "insert":
                changed[at:at] = draw(st.binary(min_size=1, max_size=16))
    return bytes(changed)


@st.composite
def text_of(draw: st.DrawFn, text: str) -> str:
    """Replace words by hostile ones or by each other; repeat, drop and exchange lines."""
    for _ in range(draw(st.integers(1, MOST_CHANGES))):
        tokens = list(TOKEN.finditer(text))
        lines = text.splitlines(keepends=True)
        if not tokens or not lines:
            break
        token = draw(st.sampled_from(tokens))
        line = draw(st.integers(0, len(lines) - 1))
        match draw(st.sampled_from(["word", "word", "other", "beside", "drop", "repeat", "swap"])):
            case "word":
                text = text[: token.start()] + draw(st.sampled_from(WORDS)) + text[token.end() :]
            case "other":
                other = draw(st.sampled_from(tokens)).group()
                text = text[: token.start()] + other + text[token.end() :]
            case "beside":
                text = text[: token.start()] + draw(st.sampled_from(WORDS)) + text[token.start() :]
            case "drop":
                text = "".join(lines[:line] + lines[line + 1 :])
            case "repeat":
                text = "".join(
                    lines[:line] + [lines[line]] * draw(st.integers(2, 9)) + lines[line:]
                )
            case "swap":
                other = draw(st.integers(0, len(lines) - 1))
                lines[line], lines[other] = lines[other], lines[line]
                text = "".join(lines)
    return text


@st.composite
def text_file_of(draw: st.DrawFn, data: bytes) -> bytes:
    """A text file changed as text, or as bytes."""
    if draw(st.integers(0, 3)) == 0:
        return draw(bytes_of(data))
    coding = draw(st.sampled_from(["utf-8"] * 8 + ["utf-16", "utf-8-sig", "cp1252"]))
    return draw(text_of(data.decode())).encode(coding, "replace")


@st.composite
def png_of(draw: st.DrawFn, data: bytes) -> bytes:
    """One chunk's content changed, before or after compression; checksums are right."""
    if draw(st.integers(0, 3)) == 0 or data[:4] != b"\x89PNG":
        return draw(bytes_of(data))
    chunks, at = [], 8
    while at < len(data):
        length = int.from_bytes(data[at : at + 4], "big")
        chunks.append((data[at + 4 : at + 8], data[at + 8 : at + 8 + length]))
        at += 12 + length
    number = draw(st.integers(0, len(chunks) - 1))
    kind, body = chunks[number]
    match draw(st.sampled_from(["body", "packed", "drop", "repeat", "move", "kind"])):
        case "body":
            chunks[number] = (kind, draw(bytes_of(body or b"\0")))
        case "packed":
            index = next(i for i, (kind, _) in enumerate(chunks) if kind == b"IDAT")
            raw = zlib.decompress(b"".join(body for kind, body in chunks if kind == b"IDAT"))
            chunks[index] = (b"IDAT", zlib.compress(draw(bytes_of(raw))))
        case "drop":
            del chunks[number]
        case "repeat":
            chunks.insert(number, (kind, body))
        case "move":
            chunks.insert(draw(st.integers(0, len(chunks) - 1)), chunks.pop(number))
        case "kind":
            others = [
                b"IHDR",
                b"PLTE",
                b"IDAT",
                b"IEND",
                b"tRNS",
                b"iCCP",
                b"acTL",
                b"fcTL",
                b"fdAT",
            ]
            chunks[number] = (draw(st.sampled_from(others)), body)
    sealed = (
        struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))
        for kind, body in chunks
    )
    return data[:8] + b"".join(sealed)


@st.composite
def zip_of(draw: st.DrawFn, data: bytes) -> bytes:
    """One member changed, dropped, doubled or renamed; the archive is whole."""
    if draw(st.integers(0, 3)) == 0 or data[:2] != b"PK":
        return draw(bytes_of(data))
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        members = [(info.filename, archive.read(info)) for info in archive.infolist()]
    # the first holds what the others mean
    number = draw(st.one_of(st.just(0), st.integers(0, len(members) - 1)))
    name, body = members[number]
    match draw(st.sampled_from(["body", "body", "body", "drop", "repeat", "name"])):
        case "body":
            members[number] = (name, draw(bytes_of(body or b"\0")))
        case "drop":
            del members[number]
        case "repeat":
            members.append((name + draw(st.sampled_from(["", "x", "/data.pkl"])), body))
        case "name":
            others = [other for other, _ in members]
            members[number] = (
                draw(st.sampled_from([*others, "../x", "constants.pkl", "x" * 300])),
                body,
            )
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        for name, body in members:
            archive.writestr(zipfile.ZipInfo(name), body)
    return buffer.getvalue()


@st.composite
def npy_of(draw: st.DrawFn, data: bytes) -> bytes:
    """The header changed as text, its length right; or the bytes."""
    if draw(st.integers(0, 2)) == 0 or data[:6] != b"\x93NUMPY":
        return draw(zip_of(data))
    length = int.from_bytes(data[8:10], "little")
    head = draw(text_of(data[10 : 10 + length].decode("latin1"))).encode("utf-8", "replace")[:65535]
    return data[:8] + struct.pack("<H", len(head)) + head + data[10 + length :]


@st.composite
def safetensors_of(draw: st.DrawFn, data: bytes) -> bytes:
    """The header, or a text of its metadata, changed as text, its length right; or the bytes."""
    if draw(st.integers(0, 3)) == 0:
        return draw(bytes_of(data))
    length = int.from_bytes(data[:8], "little")
    head = json.loads(data[8 : 8 + length])
    if draw(st.booleans()):
        metadata = head["__metadata__"]
        key = draw(st.sampled_from(sorted(metadata)))
        metadata[key] = draw(text_of(metadata[key]))
        text = json.dumps(head)
    else:
        text = draw(text_of(json.dumps(head)))
    packed = text.encode("utf-8", "replace")
    return struct.pack("<Q", len(packed)) + packed + data[8 + length :]
