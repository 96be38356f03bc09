"""Random ROS 2 messages of any type, drawn from the fields that the type says it has."""

from __future__ import annotations

from typing import Any

import numpy as np
from hypothesis import strategies as st
from rosbags.interfaces import Nodetype

from foretwin.telemetry.ros_messages.parts import typestore

_INTEGERS = {
    f"{sign}int{bits}": (0 if sign else -(2 ** (bits - 1)), 2 ** (bits - (not sign)) - 1)
    for sign in ("u", "")
    for bits in (8, 16, 32, 64)
}
_DTYPES = {"float32": np.float32, "float64": np.float64, "bool": np.bool_} | {
    name: np.dtype(name) for name in _INTEGERS
}


def messages(kind: str) -> st.SearchStrategy[Any]:
    """Return messages of a full type name; sequences hold up to 3 elements."""
    store = typestore()
    fields = {name: _of(desc) for name, desc in store.get_msgdef(kind).fields}
    return st.builds(store.types[kind], **fields)


def _of(desc: Any) -> st.SearchStrategy[Any]:
    node, details = desc
    if node == Nodetype.BASE:
        return _number(details[0])
    if node == Nodetype.NAME:
        return messages(details)
    element, length = details
    sizes = {"min_size": length, "max_size": length} if node == Nodetype.ARRAY else {"max_size": 3}
    listed = st.lists(_of(element), **sizes)
    if element[0] == Nodetype.BASE and element[1][0] in _DTYPES:
        return listed.map(lambda values: np.array(values, dtype=_DTYPES[element[1][0]]))
    return listed


def _number(name: str) -> st.SearchStrategy[Any]:
    if name in _INTEGERS:
        return st.integers(*_INTEGERS[name])
    if name.startswith("float"):
        return st.floats(width=int(name[5:]), allow_nan=False)  # type: ignore[arg-type]
    if name == "bool":
        return st.booleans()
    return st.text(max_size=5).filter(lambda text: "\0" not in text)
