"""What an output says of itself: that it is synthetic, and, if wanted, a record of what made it.

The mark is in the words that others read: the IPTC's Digital Source Type, which news agencies,
search engines and Content Credentials go by. Where containers have tags it stands there as a
sentence, too.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from html import escape, unescape
from typing import Literal

from motion_transfer.version import __version__

SourceType = Literal[
    "trainedAlgorithmicMedia", "compositeWithTrainedAlgorithmicMedia", "compositeSynthetic"
]
"""Terms of https://cv.iptc.org/newscodes/digitalsourcetype/ that an output may be."""

VOCABULARY = "http://cv.iptc.org/newscodes/digitalsourcetype/"
RECORD_NAMESPACE = "urn:motion-transfer:provenance:"
WORDS = "Synthetic: this person did not do this."
TERM = re.compile(re.escape(VOCABULARY) + r"(\w+)")
RECORD = re.compile(r'mt:provenance="([^"]*)"')


@dataclass(frozen=True)
class Mark:
    """What is written into an output.

    Attributes:
        source_type: The term that says how synthetic it is.
        record: What made it, as JSON in ASCII; None: that is not told.
    """

    source_type: str
    record: str | None = None

    @property
    def term(self) -> str:
        """The term's address."""
        return VOCABULARY + self.source_type

    @property
    def sentence(self) -> str:
        """The mark for people."""
        return f"{WORDS} {self.term}"

    @property
    def comment(self) -> str:
        """What stands in a video's comment: the record, or else the mark."""
        return self.record or self.sentence

    def xmp(self, *, with_record: bool = True) -> bytes:
        """Write it as a packet of XMP.

        Source: ISO 16684-1; the IPTC's property is of its Photo Metadata Standard.
        """
        told = ""
        if with_record and self.record is not None:
            told = f' xmlns:mt="{RECORD_NAMESPACE}" mt:provenance="{escape(self.record)}"'
        return (
            '<?xpacket begin="\ufeff" id="W5M0MpCehiHzreSzNTczkc9d"?>'
            '<x:xmpmeta xmlns:x="adobe:ns:meta/">'
            '<rdf:RDF xmlns:rdf="http://www.w3.org/1999/02/22-rdf-syntax-ns#">'
            '<rdf:Description rdf:about="" xmlns:xmp="http://ns.adobe.com/xap/1.0/"'
            ' xmlns:Iptc4xmpExt="http://iptc.org/std/Iptc4xmpExt/2008-02-29/"'
            f' xmp:CreatorTool="motion-transfer {__version__}"'
            f' Iptc4xmpExt:DigitalSourceType="{self.term}"{told}/>'
            '</rdf:RDF></x:xmpmeta><?xpacket end="w"?>'
        ).encode()


MakeMark = Callable[[list[str]], Mark]
"""Makes an output's mark from digests of what it holds: of each segment, or one of all."""


def parse_mark(text: str) -> Mark | None:
    """Find a mark in a comment or a packet of XMP; None where there is none."""
    record = next((unescape(found) for found in RECORD.findall(text)), None)
    if record is None and text.lstrip().startswith("{"):
        record = text
    term = TERM.search(text)
    return Mark(term[1], record) if term else None
