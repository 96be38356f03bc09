"""Hypothesis strategies that build any message from the types of its fields."""

from __future__ import annotations

import functools
import types
import typing
from typing import Any, Literal

import msgspec
import numpy as np
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

FLOATS = st.floats(allow_nan=False, width=64)
INTS = st.integers(-(2**63), 2**63 - 1)


@functools.cache
def messages(kind: Any) -> st.SearchStrategy[Any]:
    """Values of type `kind`: a struct, one of its field types, or anything in between.

    Of structs in a row one at most: jobs hold scenarios that hold actors, and hypothesis throws
    away whatever takes more than 8 kB of choices.
    """
    origin, arguments = typing.get_origin(kind), typing.get_args(kind)
    if isinstance(kind, type) and issubclass(kind, msgspec.Struct):
        fields = {f.name: messages(f.type) for f in msgspec.structs.fields(kind)}
        return st.fixed_dictionaries(fields).map(lambda values: kind(**values))
    if origin is np.ndarray:
        (dtype,) = typing.get_args(arguments[1])
        elements = st.floats(width=32) if dtype is np.float32 else st.floats()
        return hnp.arrays(dtype, hnp.array_shapes(max_dims=3, max_side=3), elements=elements)
    if origin is Literal:
        return st.sampled_from(arguments)
    if origin in (typing.Union, types.UnionType):
        return st.one_of([messages(argument) for argument in arguments])
    if origin is tuple and arguments[-1] is Ellipsis:
        most = (
            1 if isinstance(arguments[0], type) and issubclass(arguments[0], msgspec.Struct) else 2
        )
        return st.lists(messages(arguments[0]), max_size=most).map(tuple)
    if origin is tuple:
        return st.tuples(*(messages(argument) for argument in arguments))
    if origin is dict:
        return st.dictionaries(messages(arguments[0]), messages(arguments[1]), max_size=2)
    plain = {
        int: INTS,
        float: FLOATS,
        str: st.text(max_size=8),
        bool: st.booleans(),
        bytes: st.binary(max_size=8),
        msgspec.UnsetType: st.just(msgspec.UNSET),
        msgspec.Raw: INTS.map(lambda value: msgspec.Raw(msgspec.msgpack.encode(value))),
    }
    return st.none() if kind is type(None) else plain[kind]


def same(left: Any, right: Any) -> bool:
    """Whether two messages are equal in type and value, NaN equal to NaN, arrays by element."""
    if type(left) is not type(right):
        return False
    if isinstance(left, np.ndarray):
        return left.dtype == right.dtype and np.array_equal(left, right, equal_nan=True)
    if isinstance(left, msgspec.Struct):
        return all(same(getattr(left, n), getattr(right, n)) for n in left.__struct_fields__)
    if isinstance(left, tuple):
        return len(left) == len(right) and all(map(same, left, right))
    if isinstance(left, dict):
        return left.keys() == right.keys() and all(same(left[k], right[k]) for k in left)
    return bool(left == right)
