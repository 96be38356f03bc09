"""Elements of XML files: what is written for numbers, nothing, and words that XML cannot hold."""

from __future__ import annotations

import numpy as np
import pytest
from lxml import etree

from foretwin.world_gen.export.xml_tree import child, document, element, in_comment, leaves, number


def test_attributes_are_written_as_they_are_meant():
    made = element("lane", id=-1, s=0.5, t=np.float64(-0.0), type="none", rule=None, from_=2)
    assert list(made.attrib.items()) == [
        ("id", "-1"),
        ("s", "0.5"),
        ("t", "0"),
        ("type", "none"),
        ("from", "2"),
    ]
    assert made.text is None


def test_children_stand_in_the_order_in_which_they_are_added():
    root = element("scene")
    leaves(child(root, "sun"), {"pose": "0 0 1", "colour": "white"})
    child(root, "steps", 3)
    text = "<scene><sun><pose>0 0 1</pose><colour>white</colour></sun><steps>3</steps></scene>"
    assert etree.tostring(root).decode() == text


def test_words_of_a_map_that_xml_cannot_hold_do_not_break_a_file():
    root = element("road", name='A\x00B & "C" <D>')
    child(root, "note", "\ud800")
    read = etree.fromstring(document(root))
    assert read.get("name") == 'A?B & "C" <D>'
    assert read.findtext("note") == "?"
    root.append(etree.Comment(f" {in_comment('a--b--')} "))
    assert etree.fromstring(document(root, pretty_print=True)) is not None


@pytest.mark.parametrize(("value", "written"), [(1e-9, "1e-09"), (1234.5, "1234.5"), (-0.0, "0")])
def test_numbers_have_no_needless_digits(value, written):
    assert number(value) == written
