"""Elements of XML files, and words of a map in them: names may hold what XML cannot."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from typing import Literal

from lxml import etree

Element = etree._Element
XmlValue = str | int | float | None
"""Of an attribute or a text; an attribute that is None is left out."""
Utf8 = Literal["UTF-8", "utf-8"]
_NOT_IN_XML = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")


def element(tag: str, text: XmlValue = None, /, **attributes: XmlValue) -> Element:
    """Return an element; names of attributes that Python reserves end with an underscore."""
    made = etree.Element(tag, _written(attributes))
    made.text = _word(text)
    return made


def child(parent: Element, tag: str, text: XmlValue = None, /, **attributes: XmlValue) -> Element:
    """Add an element to another, as `element` makes it, and return it."""
    made = etree.SubElement(parent, tag, _written(attributes))
    made.text = _word(text)
    return made


def leaves(parent: Element, texts: Mapping[str, str] | Iterable[tuple[str, str]]) -> None:
    """Add elements that hold nothing but a text."""
    for tag, text in texts.items() if isinstance(texts, Mapping) else texts:
        child(parent, tag, text)


def document(root: Element, *, pretty_print: bool = False, encoding: Utf8 = "UTF-8") -> bytes:
    """Return an XML file with its declaration, which says `encoding` just so."""
    return etree.tostring(root, encoding=encoding, xml_declaration=True, pretty_print=pretty_print)


def _written(attributes: Mapping[str, XmlValue]) -> dict[str, str]:
    words = ((name.rstrip("_"), _word(value)) for name, value in attributes.items())
    return {name: word for name, word in words if word is not None}


def _word(value: XmlValue) -> str | None:
    if value is None:
        return None
    if isinstance(value, str):
        return legal(value, instead="?")
    return number(value) if isinstance(value, float) else str(value)


def number(value: float) -> str:
    """Return a number with as many digits as a nanometre over a kilometre needs."""
    return f"{value + 0.0:.12g}"


def legal(words: str, *, instead: str = "") -> str:
    """Return words with what XML 1.0 cannot hold left out, or with `instead` in its place."""
    return _NOT_IN_XML.sub(instead, words)


def in_section(words: str) -> str:
    """Return words fit for a CDATA section, which others write."""
    return legal(words).replace("]]>", "]] >")


def in_comment(words: str) -> str:
    """Return words fit for an XML comment that has a space on both sides of them."""
    return legal(words).replace("--", "- ")
