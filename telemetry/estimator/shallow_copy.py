"""Copies of filters that go on by themselves, made for every late or reordered sample."""

from __future__ import annotations

from typing import TypeVar

One = TypeVar("One")


def shallow_copy(one: One) -> One:
    """Return another object with the same attributes, not copied themselves.

    `copy.copy` goes by `__reduce_ex__` and takes three times as long, eight times a state.
    """
    other: One = object.__new__(type(one))
    other.__dict__.update(one.__dict__)
    return other
