"""Imports of a product whose modules move: from one tree alone, and with some functions watched.

Modules import each other by name, and names change between two revisions. So every module of the
product is looked at as it has run, and a function that it defines under a watched name is wrapped
before anybody else can import it. Each process appends a line for each call to a file of its own.
"""

from __future__ import annotations

import functools
import importlib.abc
import importlib.machinery
import json
import os
import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from types import ModuleType
from typing import Any

PACKAGES = frozenset({
    "foretwin", "contracts", "geometry", "telemetry", "world_gen", "sim_worker", "orchestrator",
    "viewer",
})  # fmt: skip
"""What the product's imports begin with, in any revision."""

Describe = Callable[[Mapping[str, Any], Any], dict[str, Any]]


def watch(environment: Mapping[str, str]) -> None:
    """Watch from now on, as the environment says: SAME_BITS_ROOT, _WATCH and _FOLDER."""
    names = tuple(filter(None, environment.get("SAME_BITS_WATCH", "").split(",")))
    folder = Path(environment.get("SAME_BITS_FOLDER", "."))
    sys.meta_path.insert(0, Finder(Path(environment["SAME_BITS_ROOT"]), names, folder))


class Finder(importlib.abc.MetaPathFinder):
    """Lets others find the product's modules, refuses strange ones, and wraps what is watched."""

    def __init__(self, root: Path, names: Sequence[str], folder: Path) -> None:
        self._root, self._names, self._folder = root.resolve(), tuple(names), folder

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> importlib.machinery.ModuleSpec | None:
        """Return the spec that the other finders give; ImportError where it is of another tree."""
        if fullname.partition(".")[0] not in PACKAGES:
            return None
        others = (finder for finder in sys.meta_path if finder is not self)
        found = (finder.find_spec(fullname, path, target) for finder in others)
        spec = next((spec for spec in found if spec is not None), None)
        if spec is None or spec.origin is None or spec.loader is None:
            return spec
        if not Path(spec.origin).resolve().is_relative_to(self._root):
            raise ImportError(f"{fullname} is {spec.origin}, which is not below {self._root}")
        if self._names:
            spec.loader.exec_module = functools.partial(self._exec, spec.loader.exec_module)  # type: ignore[method-assign]
        return spec

    def _exec(self, run: Callable[[ModuleType], None], module: ModuleType) -> None:
        run(module)
        for name in self._names:
            function = vars(module).get(name)
            if callable(function) and function.__module__ == module.__name__:
                setattr(module, name, self._watched(function))

    def _watched(self, function: Callable[..., Any]) -> Callable[..., Any]:
        from result_digests import DESCRIBE

        describe: Describe = DESCRIBE[function.__name__]

        @functools.wraps(function)
        def watched(*args: Any, **kwargs: Any) -> Any:
            result = function(*args, **kwargs)
            try:
                line = describe(dict(enumerate(args)) | kwargs, result)
            except Exception as error:  # never disturbs what it watches; the comparison tells
                line = {"error": f"{type(error).__name__}: {error}"}
            with (self._folder / f"{os.getpid()}.jsonl").open("a", encoding="utf-8") as file:
                file.write(json.dumps(line) + "\n")
            return result

        return watched
