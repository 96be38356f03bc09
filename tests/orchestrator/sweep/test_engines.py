"""Who plays a sweep, as the command line says it."""

from __future__ import annotations

import json
import logging
from pathlib import Path

import pytest

from foretwin.contracts.errors import UserError
from foretwin.orchestrator.sweep.engines import Engine, _log_of_the_sweep
from foretwin.orchestrator.sweep.spec import load_spec
from foretwin.orchestrator.sweep.workers import worker_setup
from tests.log_lines import read_log
from tests.orchestrator.sweeps import small_sweep


@pytest.mark.parametrize(
    ("engine", "why"),
    [
        (Engine("dask"), "--engine dask: one of zenoh, ray"),
        (Engine("zenoh", address="h:1"), "--address h:1: goes with --engine ray alone"),
        (Engine("zenoh", 0), "--workers 0: 1 to "),
        (Engine("ray", 0), "--workers 0: 1 to "),
        (Engine("ray", 0, "h:1"), "--workers 0: at least 1"),
    ],
)
def test_what_cannot_be_is_told_in_one_line(engine: Engine, why: str) -> None:
    with pytest.raises(UserError) as caught:
        engine.check()
    assert str(caught.value).startswith(why)


@pytest.mark.parametrize("engine", [Engine(), Engine("ray"), Engine("ray", 5000, "h:1")])
def test_a_cluster_may_have_more_processors_than_this_machine(engine: Engine) -> None:
    engine.check()


def test_the_log_of_a_sweep_holds_seats_lines_as_they_are_and_our_own(tmp_path: Path) -> None:
    setup = worker_setup(load_spec(small_sweep(tmp_path)), tmp_path)
    line = json.dumps({"process": "node-7", "text": "100 % of it"}).encode()
    with _log_of_the_sweep(setup) as add:
        add(line)
        logging.getLogger("orchestrator").warning("ray: a node died")
    logging.getLogger("orchestrator").warning("no more")
    lines = read_log(Path(setup.log_file)).lines
    assert [(one["process"], one["text"]) for one in lines] == [
        ("node-7", "100 % of it"),
        ("orchestrator", "ray: a node died"),
    ]
