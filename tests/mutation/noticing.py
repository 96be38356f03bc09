"""Whether the tests of a module notice that it was changed, in a checkout of HEAD of its own."""

from __future__ import annotations

import ast
import contextlib
import itertools
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Literal

from tests.mutation.users import users_of
from tests.test_layout import ROOT
from tests.test_mirrored import covered, mirror_of, mirrored, modules

Fate = Literal["killed", "timed out", "survived", "untested"]
_PATIENCE, _LEAST_S = 4.0, 20.0
"""Times what the tests take unchanged, and at least: a mutant that waits for ever is noticed."""


def files_of(module: str, *, system: bool = False) -> list[str]:
    """Return the test files that mirror a module, name it, or lie beside its mirror and import it.

    The mirror first; those of several processes, which take minutes, with `system` alone.
    """
    mirror = mirror_of(modules()[module])
    found = [mirror] if module in mirrored() else []
    found += [ROOT / path for path in covered().get(module, ())]
    found += [path for path in sorted(mirror.parent.glob("test_*.py")) if module in _imports(path)]
    names = dict.fromkeys(str(path.relative_to(ROOT)) for path in found)
    return [name for name in names if system or not _takes_long(name)]


def _takes_long(name: str) -> bool:
    return name.startswith("tests/system/") or name.endswith("_system.py")


@cache
def _imports(test: Path) -> frozenset[str]:
    """Return what a test imports, and what the modules beside it do that it imports."""
    found: set[str] = set()
    for node in ast.walk(ast.parse(test.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found |= {one.name for one in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            found |= {node.module, *(f"{node.module}.{one.name}" for one in node.names)}
            beside = ROOT / Path(*node.module.split(".")).with_suffix(".py")
            if beside.parent == test.parent and beside.is_file():
                found |= _imports(beside)
    return frozenset(found)


class Checkout:
    """A tree whose modules can be changed; what each test file takes unchanged is measured once.

    One process serves all (`warm_pytest.py`). Each changed file gets a time of its own, so that no
    bytecode of another is taken for its.
    """

    def __init__(self, tree: Path) -> None:
        self.tree = tree
        self._taken_s: dict[str, float] = {}
        self._times_s = itertools.count(1_000_000)
        without = {key: value for key, value in os.environ.items() if not key.startswith("PYTEST_")}
        self._pytest = subprocess.Popen(
            [sys.executable, "-P", Path(__file__).with_name("warm_pytest.py")],
            cwd=tree, env=without | {"PYTHONPATH": str(tree)}, text=True,
            stdin=subprocess.PIPE, stdout=subprocess.PIPE,
        )  # fmt: skip

    def close(self) -> None:
        """End the process that runs the tests."""
        self._pytest.communicate()

    def fate(self, module: str, text: str, *, system: bool = False) -> Fate:
        """Put a text in a module's place, run its tests, and put back what was there.

        Where they notice nothing, those of the modules that use what was changed. Raises
        RuntimeError where the tests fail unchanged.
        """
        tests = tuple(files_of(module, system=system))
        told = self._fate_by(tests, module, text) if tests else "untested"
        if told in ("survived", "untested"):
            others = [name for user in users_of(module, text) for name in files_of(user)]
            further = tuple(name for name in dict.fromkeys(others) if name not in tests)
            told = self._fate_by(further, module, text) if further else told
        return told

    def _fate_by(self, tests: tuple[str, ...], module: str, text: str) -> Fate:
        for test in tests:
            if test not in self._taken_s:
                self._measure(test)
        within_s = self._within_s(tests)
        told = self._changed(module, text, tests, within_s)
        if told == "timed out":
            for test in tests:
                self._measure(test)
            if self._within_s(tests) > within_s:  # the machine has become slow meanwhile
                told = self._changed(module, text, tests, self._within_s(tests))
        fates: dict[str, Fate] = {"passed": "survived", "failed": "killed"}
        return fates.get(told, "timed out")

    def _changed(self, module: str, text: str, tests: tuple[str, ...], within_s: float) -> str:
        target = self.tree / modules()[module].relative_to(ROOT)
        target.write_text(text, encoding="utf-8")
        time_s = next(self._times_s)
        os.utime(target, (time_s, time_s))
        try:
            return self._told(tests, within_s)
        finally:
            subprocess.run(["git", "checkout", "-q", "--", "."], cwd=self.tree, check=True)

    def _within_s(self, tests: tuple[str, ...]) -> float:
        return max(_LEAST_S, _PATIENCE * sum(self._taken_s[test] for test in tests))

    def _measure(self, test: str) -> None:
        begun_s = time.monotonic()
        if self._told((test,), None) != "passed":
            raise RuntimeError(f"{test}: fails with nothing changed")
        self._taken_s[test] = time.monotonic() - begun_s

    def _told(self, tests: tuple[str, ...], within_s: float | None) -> str:
        asked, answers = self._pytest.stdin, self._pytest.stdout
        assert asked is not None
        assert answers is not None
        asked.write(json.dumps({"tests": tests, "within_s": within_s}) + "\n")
        asked.flush()
        if not (line := answers.readline()):
            raise RuntimeError("the process that runs the tests is gone")
        return str(json.loads(line)["fate"])


@contextmanager
def checkout() -> Iterator[Checkout]:
    """Check HEAD out into a folder that is gone afterwards."""
    with tempfile.TemporaryDirectory(prefix="broken-lines-") as folder:
        tree = Path(folder) / "tree"
        subprocess.run(["git", "worktree", "add", "-q", "--detach", tree], cwd=ROOT, check=True)
        try:
            with contextlib.closing(Checkout(tree)) as changed:
                yield changed
        finally:
            subprocess.run(["git", "worktree", "remove", "--force", tree], cwd=ROOT, check=True)
