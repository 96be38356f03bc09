"""How much an object holds on to: entries of all containers that can be reached from it."""

from __future__ import annotations

import collections
import gc
import types
from typing import Any

_NOT_HELD = (types.ModuleType, types.FunctionType, types.BuiltinFunctionType, types.FrameType, type)
_CONTAINERS = (list, dict, set, frozenset, tuple, collections.deque)


def entries(root: Any) -> int:
    """Return how many entries all containers reachable from `root` have together.

    Modules, classes and functions belong to the program, not to what runs.
    """
    gc.collect()
    seen, waiting, count = {id(root)}, [root], 0
    while waiting:
        one = waiting.pop()
        if isinstance(one, _CONTAINERS):
            count += len(one)
        for held in gc.get_referents(one):
            if id(held) not in seen and not isinstance(held, _NOT_HELD):
                seen.add(id(held))
                waiting.append(held)
    return count
