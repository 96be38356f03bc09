"""Whether the tests of a module notice that it was changed, in a checkout of HEAD of its own."""

from __future__ import annotations

import ast
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

from tests.test_layout import ROOT
from tests.test_mirrored import covered, mirror_of, mirrored, modules

Fate = Literal["killed", "timed out", "survived", "untested"]
_PATIENCE, _LEAST_S = 5.0, 30.0
"""Times what the tests take unchanged, and at least: a mutant that waits for ever is noticed."""


def files_of(module: str, *, system: bool = False) -> list[str]:
    """Return the test files that mirror a module, name it, or lie beside its mirror and import it.

    The mirror first; those of several processes, which take minutes, with `system` alone.
    """
    mirror = mirror_of(modules()[module])
    found = [mirror] if module in mirrored() else []
    found += [ROOT / path for path in covered().get(module, ())]
    found += [path for path in sorted(mirror.parent.glob("test_*.py")) if _imports(path, module)]
    names = dict.fromkeys(str(path.relative_to(ROOT)) for path in found)
    return [name for name in names if system or not _takes_long(name)]


def _takes_long(name: str) -> bool:
    return name.startswith("tests/system/") or name.endswith("_system.py")


@cache
def _imports(test: Path, module: str) -> bool:
    package, _, last = module.rpartition(".")
    for node in ast.walk(ast.parse(test.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and (
            node.module == module
            or (node.module == package and any(one.name == last for one in node.names))
        ):
            return True
        if isinstance(node, ast.Import) and any(one.name == module for one in node.names):
            return True
    return False


class Checkout:
    """A tree whose modules can be changed; what the tests take unchanged is measured once."""

    def __init__(self, tree: Path) -> None:
        self.tree = tree
        self._taken_s: dict[tuple[str, ...], float] = {}

    def fate(self, module: str, text: str, *, system: bool = False) -> Fate:
        """Put a text in a module's place, run its tests, and put back what was there.

        Raises RuntimeError where the tests fail unchanged.
        """
        tests = tuple(files_of(module, system=system))
        if not tests:
            return "untested"
        within_s = self._within_s(tests)
        target = self.tree / modules()[module].relative_to(ROOT)
        target.write_text(text, encoding="utf-8")
        try:
            return "survived" if self._pass(tests, within_s) else "killed"
        except subprocess.TimeoutExpired:
            return "timed out"
        finally:
            subprocess.run(["git", "checkout", "-q", "--", "."], cwd=self.tree, check=True)

    def _within_s(self, tests: tuple[str, ...]) -> float:
        if tests not in self._taken_s:
            begun_s = time.monotonic()
            if not self._pass(tests, None):
                raise RuntimeError(f"{' '.join(tests)}: fail with nothing changed")
            self._taken_s[tests] = time.monotonic() - begun_s
        return max(_LEAST_S, _PATIENCE * self._taken_s[tests])

    def _pass(self, tests: tuple[str, ...], within_s: float | None) -> bool:
        command = [sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider", *tests]
        environment = os.environ | {"PYTHONPATH": str(self.tree), "PYTHONDONTWRITEBYTECODE": "1"}
        with subprocess.Popen(
            command, cwd=self.tree, env=environment, stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL, start_new_session=True,
        ) as process:  # fmt: skip
            try:
                return process.wait(within_s) == 0
            except subprocess.TimeoutExpired:
                os.killpg(process.pid, 9)
                raise


@contextmanager
def checkout() -> Iterator[Checkout]:
    """Check HEAD out into a folder that is gone afterwards."""
    with tempfile.TemporaryDirectory(prefix="broken-lines-") as folder:
        tree = Path(folder) / "tree"
        subprocess.run(["git", "worktree", "add", "-q", "--detach", tree], cwd=ROOT, check=True)
        try:
            yield Checkout(tree)
        finally:
            subprocess.run(["git", "worktree", "remove", "--force", tree], cwd=ROOT, check=True)
