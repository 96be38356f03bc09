"""Modules of the product come from one tree alone, and what is watched leaves a line."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

from tests.same_bits.sides import INJECTED

RUN_JOB = """
from types import SimpleNamespace

def run_job(job, stage):
    return SimpleNamespace(round_id=7, job_index=job, world_id=stage, variant_indices=(0,))
"""


def a_tree(folder: Path) -> Path:
    """A product of two modules: one runs jobs, the other imports it by name."""
    package = folder / "tree" / "sim_worker"
    (package / "deep").mkdir(parents=True)
    (package / "__init__.py").touch()
    (package / "deep" / "runs.py").write_text(RUN_JOB)
    (package / "worker.py").write_text("from sim_worker.deep.runs import run_job\n")
    return folder / "tree"


def python(root: Path, told: Path, code: str, *path: Path) -> subprocess.CompletedProcess[str]:
    told.mkdir(exist_ok=True)
    return subprocess.run(
        [sys.executable, "-P", "-c", code], cwd=told, capture_output=True, text=True, check=False,
        env=os.environ | {
            "PYTHONPATH": os.pathsep.join(map(str, (INJECTED, *path))),
            "SAME_BITS_ROOT": str(root), "SAME_BITS_FOLDER": str(told),
            "SAME_BITS_WATCH": "run_job",
        },
    )  # fmt: skip


def test_a_call_leaves_a_line_wherever_the_function_lives(tmp_path: Path) -> None:
    tree, told = a_tree(tmp_path), tmp_path / "told"

    done = python(tree, told, "from sim_worker.worker import run_job; run_job(2, 'w')", tree)

    assert done.returncode == 0, done.stderr
    (file,) = told.glob("*.jsonl")
    assert json.loads(file.read_text())["key"] == "round 7 job 2 world w variants 0"


def test_what_cannot_be_described_is_told_and_disturbs_nothing(tmp_path: Path) -> None:
    tree, told = a_tree(tmp_path), tmp_path / "told"
    (tree / "sim_worker" / "deep" / "runs.py").write_text("def run_job(job):\n    return job\n")

    done = python(tree, told, "from sim_worker.worker import run_job; print(run_job(2))", tree)

    assert done.stdout == "2\n"
    (file,) = told.glob("*.jsonl")
    assert "JOB_KEY" in json.loads(file.read_text())["error"]


def test_a_module_of_another_tree_is_refused(tmp_path: Path) -> None:
    tree, told = a_tree(tmp_path), tmp_path / "told"
    mine = tmp_path / "mine"
    mine.mkdir()

    done = python(mine, told, "import sim_worker.worker", tree)

    assert done.returncode == 1
    assert f"which is not below {mine}" in done.stderr
