"""The command `doctor`: what this machine has, what is missing, and what that costs."""

from __future__ import annotations

import importlib.metadata
import os
import platform
import shutil
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Literal, NamedTuple

from foretwin.contracts.did_you_mean import one_of
from foretwin.contracts.errors import UserError
from foretwin.orchestrator.commands.told import CommandResult

Verdict = Literal["ok", "missing", "note"]

_BUS_S = 20.0
"""How long a busy machine may take for one question over the bus."""


class CheckResult(NamedTuple):
    """One line of the examination."""

    what: str
    verdict: Verdict
    text: str


def examine() -> CommandResult:
    """Return every finding; its code is 3 where something that a drive needs is missing."""
    findings = [check() for check in CHECKS]
    marks = {"ok": "ok     ", "missing": "MISSING", "note": "note   "}
    lines = [f"{marks[one.verdict]}  {one.what}: {one.text}" for one in findings]
    code = 3 if any(one.verdict == "missing" for one in findings) else 0
    return CommandResult([one._asdict() for one in findings], "\n".join(lines), code)


def examine_bus(endpoint: str | None, folder: Path | None, *, role: str) -> CommandResult:
    """Return why a bus with certificates does not let a role in; 3 where a cause was found.

    Raises UserError where endpoint or folder are missing or no such thing.
    """
    from foretwin.contracts.bus import BusUnreachable, ZenohBus
    from foretwin.contracts.campaign import CAMPAIGN_ROLES, certificate_in, role_files, worker_name
    from foretwin.contracts.ports import tls_place
    from foretwin.contracts.setup import BusSetup
    from foretwin.contracts.why_refused import ADMITTED, likely_causes

    if endpoint is None or folder is None or tls_place(endpoint) is None:
        raise UserError(
            "doctor needs both --endpoint tls/HOST:PORT and --secure FOLDER, or neither"
        )
    if role not in CAMPAIGN_ROLES and worker_name(role) is None:
        raise UserError(f"--role {role}: {one_of(role, CAMPAIGN_ROLES)}")
    own = not (folder / role).is_dir()
    setup = BusSetup(
        endpoint=endpoint, tls=certificate_in(folder) if own else role_files(folder, role)
    )
    causes = list(likely_causes(setup))
    if not causes:
        try:
            with ZenohBus(setup):
                return CommandResult({"role": role, "causes": []}, f"ok       {ADMITTED}")
        except BusUnreachable as error:
            causes = [str(error)]
    words = "\n".join(f"cause    {cause}" for cause in causes)
    return CommandResult({"role": role, "causes": causes}, words, 3)


def _python() -> CheckResult:
    good = sys.version_info >= (3, 11)
    return CheckResult(
        "Python", "ok" if good else "missing", f"{platform.python_version()}, 3.11 or newer"
    )


def _cores() -> CheckResult:
    count = os.cpu_count() or 1
    text = f"{count} cores; a live drive at 64 futures twice a second was measured on 2"
    return CheckResult("processor", "ok" if count >= 2 else "note", text)


def _tuning() -> CheckResult:
    from foretwin.orchestrator.config import DriveConfig

    choice = DriveConfig().tuning_choice
    text = f"{choice.mode}; {choice.why}"
    return CheckResult("tuning", "note" if choice.mode == "off" else "ok", text)


def _packages() -> CheckResult:
    names = (
        "mujoco",
        "eclipse-zenoh",
        "rerun-sdk",
        "osmium",
        "shapely",
        "pyproj",
        "pyarrow",
        "cryptography",
    )
    versions, absent = [], []
    for name in names:
        try:
            versions.append(f"{name} {importlib.metadata.version(name)}")
        except importlib.metadata.PackageNotFoundError:
            absent.append(name)
    if absent:
        return CheckResult(
            "packages", "missing", f"not installed: {', '.join(absent)}; run make setup"
        )
    return CheckResult("packages", "ok", ", ".join(versions))


def _bus() -> CheckResult:
    import contextlib
    import threading

    from foretwin.contracts.bus import Mailbox, Request, ZenohBus, ask
    from foretwin.contracts.drive import InfoRequest, VehicleInfo
    from foretwin.contracts.ports import free_endpoint
    from foretwin.contracts.setup import BusSetup

    setup = BusSetup(endpoint=free_endpoint())
    with (
        ZenohBus(setup, router=True) as router,
        ZenohBus(setup) as client,
        contextlib.closing(Mailbox(4)) as mailbox,
    ):
        client.serve("info", mailbox, vehicle="doctor")

        def answer() -> None:
            while isinstance(request := mailbox.take(None), Request):
                request.reply(VehicleInfo(vehicle_id="doctor", time_base="log", start_stamp_ns=0))

        threading.Thread(target=answer, daemon=True).start()
        deadline = time.monotonic() + _BUS_S
        while time.monotonic() < deadline:
            started = time.perf_counter()
            try:
                ask(router, "info", InfoRequest(), vehicle="doctor", timeout_s=1.0)
            except TimeoutError:
                continue
            taken_ms = 1e3 * (time.perf_counter() - started)
            return CheckResult(
                "Zenoh over loopback", "ok", f"question and answer in {taken_ms:.1f} ms"
            )
    text = f"no answer in {_BUS_S:.0f} s; is loopback filtered?"
    return CheckResult("Zenoh over loopback", "missing", text)


def _clock() -> CheckResult:
    from foretwin.sim_worker.vehicle.clock import silence_step_clock

    if silence_step_clock():
        return CheckResult("MuJoCo's step clock", "ok", "switched off")
    return CheckResult(
        "MuJoCo's step clock", "note", "cannot be switched off here; steps are slower"
    )


def _vulkan() -> CheckResult:
    folders = [Path("/usr/share/vulkan/icd.d"), Path("/etc/vulkan/icd.d")]
    drivers = sorted(p.stem for f in folders if f.is_dir() for p in f.glob("*.json"))
    if drivers:
        return CheckResult("Vulkan drivers", "ok", ", ".join(drivers))
    text = "none: no pictures and no native viewer (Debian: mesa-vulkan-drivers)"
    return CheckResult("Vulkan drivers", "note", text)


def _display() -> CheckResult:
    from foretwin.orchestrator.config import has_display

    if has_display():
        return CheckResult("display", "ok", "--view auto opens the native viewer")
    return CheckResult("display", "note", "none: --view auto writes monitor.rrd alone")


def _disk() -> CheckResult:
    free_gb = shutil.disk_usage(tempfile.gettempdir()).free / 1e9
    return CheckResult("disk", "ok" if free_gb > 2 else "note", f"{free_gb:.1f} GB free")


def _data() -> CheckResult:
    folder = os.environ.get("FORETWIN_DATA")
    if folder and Path(folder).is_dir():
        return CheckResult("FORETWIN_DATA", "ok", "set: real-data tests run")
    return CheckResult("FORETWIN_DATA", "note", "not set: real-data tests skip (drives need none)")


_MACHINE = _python, _cores, _tuning, _packages, _bus, _clock
CHECKS: tuple[Callable[[], CheckResult], ...] = (*_MACHINE, _vulkan, _display, _disk, _data)
