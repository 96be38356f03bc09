"""Words of a map in XML files: names may hold what XML cannot, and what would end a comment."""

from __future__ import annotations

import re

_NOT_IN_XML = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")


def legal(words: str, *, instead: str = "") -> str:
    """Return words with what XML 1.0 cannot hold left out, or with `instead` in its place."""
    return _NOT_IN_XML.sub(instead, words)


def in_comment(words: str) -> str:
    """Return words fit for an XML comment that has a space on both sides of them."""
    return legal(words).replace("--", "- ")
