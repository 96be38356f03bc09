"""The files for clusters: what they start is a command of ours, and what they say has its schema.

Slurm itself runs them where sbatch, slurmctld, slurmd and munged are (Debian: slurmctld slurmd
slurm-client munge), Ray in an environment that RAY_VENV names. KubeRay's schema comes from the
checkout of ray-project/kuberay that KUBERAY_SOURCE names.
"""

from __future__ import annotations

import json
import os
import shlex
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from foretwin.orchestrator.commands.cli import run
from tests.orchestrator.sweeps import small_sweep
from tests.system.foretwin_command import REPOSITORY
from tests.system.ray_nodes import RayNodes, ray_python

yaml = pytest.importorskip("yaml")

FOLDER = REPOSITORY / "examples" / "cluster"
SCRIPTS = sorted(FOLDER.glob("*.slurm"))
KUBERAY = FOLDER / "sweep_on_kuberay.yaml"
SHARDS = 2


def manifest(path: Path) -> dict[str, Any]:
    (found,) = yaml.safe_load_all(path.read_text())
    assert isinstance(found, dict)
    return found


@pytest.fixture(scope="module")
def played(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    """A small spec, and the hash of its rows by a worker process of this machine."""
    folder = tmp_path_factory.mktemp("cluster")
    spec, out = small_sweep(folder), folder / "zenoh"
    assert run(["sweep", str(spec), "--out", str(out), "--workers", "1"]) == 0
    return spec, rows_sha256(out)


def rows_sha256(out: Path) -> str:
    return str(json.loads((out / "sweep.json").read_text())["rows_sha256"])


@pytest.mark.parametrize("script", SCRIPTS, ids=lambda one: one.name)
def test_a_script_is_one(script: Path) -> None:
    subprocess.run(["bash", "-n", str(script)], check=True)
    asked = [line for line in script.read_text().splitlines() if line.startswith("#SBATCH")]
    assert any("--cpus-per-task=" in line for line in asked)
    without = subprocess.run(["bash", str(script)], capture_output=True, text=True, check=False)
    assert without.returncode == 1
    assert "usage: sbatch " in without.stderr
    assert f"{script.name} SPEC OUT" in without.stderr


def test_the_ray_job_starts_a_command_of_ours_on_nodes_of_one_image() -> None:
    spec = manifest(KUBERAY)["spec"]
    command = shlex.split(spec["entrypoint"])
    assert command[:2] == ["foretwin", "sweep"]
    assert run([*command[1:2], "--help"]) == 0
    cluster = spec["rayClusterSpec"]
    pods = [cluster["headGroupSpec"], *cluster["workerGroupSpecs"]]
    containers = [one for pod in pods for one in pod["template"]["spec"]["containers"]]
    assert len({one["image"] for one in containers}) == 1
    assert cluster["authOptions"] == {"mode": "token"}
    assert pods[0]["rayStartParams"]["num-cpus"] == "0"


def test_the_indexed_job_names_as_many_shards_as_it_has_pods() -> None:
    spec = manifest(FOLDER / "sweep_in_shards.yaml")["spec"]
    (container,) = spec["template"]["spec"]["containers"]
    command = container["command"][-1]
    assert (spec["completionMode"], container["command"][:2]) == ("Indexed", ["sh", "-c"])
    assert f'"$JOB_COMPLETION_INDEX/{spec["completions"]}"' in command
    assert f"--workers {container['resources']['limits']['cpu']}" in command


def one_shard_of_a_slurm_array(spec: Path, out: Path) -> tuple[list[str], str]:
    script = str(FOLDER / "sweep_in_shards.slurm")
    return ["bash", script, str(spec), str(out), str(SHARDS)], "SLURM_ARRAY_TASK_ID"


def one_shard_of_an_indexed_job(spec: Path, out: Path) -> tuple[list[str], str]:
    pod = manifest(FOLDER / "sweep_in_shards.yaml")["spec"]["template"]["spec"]
    *shell, command = pod["containers"][0]["command"]
    command = command.replace("/sweeps/town.toml", str(spec)).replace("/sweeps/town", str(out))
    return [
        *shell,
        command.replace("16", str(SHARDS)).replace("s 8", "s 1"),
    ], "JOB_COMPLETION_INDEX"


@pytest.mark.judge
@pytest.mark.parametrize("one_shard", [one_shard_of_a_slurm_array, one_shard_of_an_indexed_job])
def test_shards_of_a_cluster_are_merged_to_the_rows_of_one_sweep(
    one_shard: Callable[[Path, Path], tuple[list[str], str]],
    played: tuple[Path, str],
    tmp_path: Path,
) -> None:
    spec, expected = played
    arguments, number = one_shard(spec, tmp_path / "out")
    path = f"{Path(sys.executable).parent}:{os.environ['PATH']}"
    for shard in range(SHARDS):
        env = os.environ | {"PATH": path, number: str(shard), "SLURM_CPUS_PER_TASK": "1"}
        ended = subprocess.run(arguments, env=env, capture_output=True, text=True, check=False)
        assert ended.returncode == 0, ended.stdout + ended.stderr
    shards = [str(one) for one in tmp_path.glob(f"out-*-of-{SHARDS}")]
    assert run(["sweep", "--merge", *shards, "--out", str(tmp_path / "out")]) == 0
    assert rows_sha256(tmp_path / "out") == expected


@pytest.mark.judge
def test_kuberays_own_schema_takes_the_ray_job() -> None:
    jsonschema = pytest.importorskip("jsonschema")
    if "KUBERAY_SOURCE" not in os.environ:
        pytest.skip("KUBERAY_SOURCE names no checkout of ray-project/kuberay")
    crds = Path(os.environ["KUBERAY_SOURCE"]) / "ray-operator" / "config" / "crd" / "bases"
    crd = yaml.safe_load((crds / "ray.io_rayjobs.yaml").read_text())
    (version,) = (one for one in crd["spec"]["versions"] if one["name"] == "v1")
    schema = version["schema"]["openAPIV3Schema"]
    for closed in closing(schema):
        closed["additionalProperties"] = False  # as the API server warns of fields it drops
    validator = jsonschema.Draft7Validator(schema)
    found = manifest(KUBERAY)
    metadata = found.pop("metadata")
    assert set(metadata) == {"name"}
    assert [error.message for error in validator.iter_errors(found)] == []
    found["spec"]["rayClusterSpec"]["workerGroupSpecs"][0]["replica"] = 3
    assert len(list(validator.iter_errors(found))) == 1


def closing(schema: Any) -> Iterator[dict[str, Any]]:
    """Yield the objects of a schema that name all their fields."""
    if isinstance(schema, list):
        for one in schema:
            yield from closing(one)
    elif isinstance(schema, dict):
        for one in schema.values():
            yield from closing(one)
        if isinstance(schema.get("properties"), dict) and schema.get("type") == "object":
            yield schema


@pytest.mark.judge
def test_the_command_of_the_ray_job_gives_the_rows(
    played: tuple[Path, str], tmp_path: Path
) -> None:
    spec, expected = played
    command = manifest(KUBERAY)["spec"]["entrypoint"]
    command = command.replace("/sweeps/town.toml", str(spec)).replace("/sweeps/town", str(tmp_path))
    with RayNodes(2) as nodes:
        nodes.start(0, processors=0)
        nodes.start(1)
        arguments = [nodes.address if one == "auto" else one for one in shlex.split(command)]
        ended = nodes.run("-m", *arguments)
    assert ended.returncode == 0, ended.stderr
    assert rows_sha256(tmp_path) == expected


SRUN = """#!/bin/bash
while [[ $1 == --* ]]; do shift; done
exec "$@"
"""


@pytest.mark.judge
def test_the_script_for_slurm_gives_the_rows_where_slurm_is_played(
    played: tuple[Path, str], tmp_path: Path
) -> None:
    spec, expected = played
    commands = on_path(tmp_path, srun=SRUN)
    given = {"SLURM_JOB_ID": "7", "SLURM_JOB_NUM_NODES": "1", "SLURM_CPUS_PER_TASK": "2"}
    with RayNodes(1) as machine:
        ended = machine.alone(
            "env", f"PATH={commands}:{os.environ['PATH']}", f"RAY_HEAD_IP={machine.ip(0)}",
            *(f"{name}={value}" for name, value in given.items()),
            "bash", str(FOLDER / "sweep_on_ray.slurm"), str(spec), str(tmp_path / "out"),
        )  # fmt: skip
    assert ended.returncode == 0, ended.stdout + ended.stderr
    assert rows_sha256(tmp_path / "out") == expected


def on_path(folder: Path, **scripts: str) -> Path:
    """Return a folder of commands: these, and of the environment with Ray `ray` and `foretwin`."""
    python = ray_python()
    ours = {"foretwin": f'#!/bin/bash\nexec {python} -m foretwin "$@"\n'}
    ours["ray"] = f'#!/bin/bash\nexec {python.with_name("ray")} "$@"\n'
    (folder / "commands").mkdir()
    for name, text in (ours | scripts).items():
        (folder / "commands" / name).write_text(text)
        (folder / "commands" / name).chmod(0o755)
    return folder / "commands"
