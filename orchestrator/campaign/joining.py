"""How the processes of a drive join its bus over a network: each by the certificate of its role."""

from __future__ import annotations

import datetime
import json
from pathlib import Path

from foretwin.contracts.access import BusMember, access_control
from foretwin.contracts.campaign import (
    CAMPAIGN_ROLES,
    CampaignRole,
    TlsFiles,
    certificate_in,
    named_workers,
    role_files,
    worker_name,
)
from foretwin.contracts.certificates import (
    UTC,
    host_trouble,
    read_certificate,
    time_trouble,
    troubles,
)
from foretwin.contracts.errors import UserError
from foretwin.contracts.fleet import far_id
from foretwin.contracts.ports import tls_place
from foretwin.contracts.process_setup import Admission

LOCAL_ROLES: tuple[CampaignRole, ...] = ("router", "orchestrator", "worker", "viewer", "recorder")
"""Of the processes that every drive starts itself."""
_ONE_PROCESS = "orchestrator", "viewer", "recorder"
"""Roles of a single process, named like them: they can hold no other one's token."""
_BESIDE: dict[CampaignRole, tuple[str, ...]] = {"viewer": ("copilot",)}
"""But for these: the co-pilot display is a viewer, too."""


def check_campaign(
    folder: Path, endpoint: str, *, car: bool, now: datetime.datetime | None = None
) -> None:
    """Raise UserError where a process of a drive could not join; `car`: one of them is the car's.

    Said before anything is started: a process that is refused hears nothing but a time-out.
    """
    now = now or datetime.datetime.now(UTC)
    for role in _roles(car=car):
        for line in troubles(role_files(folder, role), now=now):
            raise UserError(line)
    place = tls_place(endpoint)
    assert place is not None
    if (trouble := host_trouble(role_files(folder, "router"), place.host)) is not None:
        raise UserError(trouble)


def admission(run_id: str, campaign: Path | None = None) -> Admission:
    """Return whom a run's router lets in by their certificates, and what each role may say.

    The machines of a `campaign` whose workers join have names: each speaks for its own alone.
    """
    members = [
        BusMember(
            role,
            role,
            process_id=role if role in _ONE_PROCESS else "*",
            beside=_BESIDE.get(role, ()),
        )
        for role in CAMPAIGN_ROLES
        if role != "router"
    ]
    members += [
        BusMember(role, "worker", process_id=far_id(str(worker_name(role)), "$*"))
        for role in (() if campaign is None else named_workers(campaign))
    ]
    access = access_control(members, subject="cert_common_names", run_id=run_id)
    return Admission(access=json.dumps(access))


def ends(folder: Path, *, car: bool) -> datetime.datetime:
    """Return when the first link of a drive closes since a certificate has expired."""
    files = (role_files(folder, role) for role in _roles(car=car))
    return min(read_certificate(Path(one.certificate)).last for one in files)


def _roles(*, car: bool) -> tuple[CampaignRole, ...]:
    return (*LOCAL_ROLES, "car") if car else LOCAL_ROLES


def own_certificate(folder: Path, role: CampaignRole) -> TlsFiles:
    """Return a role's files from the folder of its campaign or from the role's own, copied one.

    Raises UserError where they are missing or out of time.
    """
    files = role_files(folder, role) if (folder / role).is_dir() else certificate_in(folder)
    certificate = read_certificate(Path(files.certificate))
    if line := time_trouble(certificate, files.certificate, now=datetime.datetime.now(UTC)):
        raise UserError(line)
    return files
