"""The folder of a campaign: who may join its bus over a network, each role with its certificate.

    FOLDER/ca.pem, ca.key            of the campaign's own authority; the key makes further roles
    FOLDER/ROLE/ca.pem               what a role needs, to be copied whole to where it runs:
    FOLDER/ROLE/certificate.pem      whom to trust, who it is,
    FOLDER/ROLE/key.pem              and the proof of it

The common name of a certificate is its role; the router's access rules go by it. A machine whose
workers join a drive has a role of its own, worker-NAME, so that it can be told from others, and
shut out by taking its folder away.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Literal, get_args

import msgspec

from foretwin.contracts.errors import UserError

CampaignRole = Literal[
    "router", "orchestrator", "worker", "viewer", "recorder", "car", "planner", "operator"
]
CAMPAIGN_ROLES: tuple[CampaignRole, ...] = get_args(CampaignRole)
NAMED_WORKER = "worker-NAME"
_NAMED_WORKER = re.compile(r"worker-([a-z0-9]{1,40})")
AUTHORITY, AUTHORITY_KEY = "ca.pem", "ca.key"
CERTIFICATE, KEY = "certificate.pem", "key.pem"
_OTHERS = 0o077


class TlsFiles(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Where the certificate of a process lies, its key, and the authority that it trusts."""

    authority: str
    certificate: str
    key: str


def worker_name(role: str) -> str | None:
    """Return the NAME of worker-NAME, small letters and digits; None for any other role."""
    found = _NAMED_WORKER.fullmatch(role)
    return None if found is None else found[1]


def named_workers(campaign: Path) -> tuple[str, ...]:
    """Return the roles worker-NAME of a campaign."""
    return tuple(
        sorted(one.name for one in campaign.iterdir() if one.is_dir() and worker_name(one.name))
    )


def role_files(campaign: Path, role: str) -> TlsFiles:
    """Return a role's files in the folder of a campaign; raises UserError, see `certificate_in`."""
    if not (campaign / AUTHORITY).is_file() and not (campaign / role).is_dir():
        how = f"`foretwin secure init --folder {campaign}` begins one"
        raise UserError(f"{campaign}: no folder of a campaign; {how}")
    return certificate_in(campaign / role, f"foretwin secure add {role} --folder {campaign}")


def certificate_in(folder: Path, how_to_make: str = "foretwin secure add ROLE") -> TlsFiles:
    """Return the files of one role's own folder, with whole paths.

    Raises UserError where one is missing or a key can be read by other users of this machine.
    """
    files = [(folder / name).resolve() for name in (AUTHORITY, CERTIFICATE, KEY)]
    for file in files:
        if not file.is_file():
            raise UserError(f"{file}: missing; `{how_to_make}` makes it")
    key = files[2]
    if mode := key.stat().st_mode & _OTHERS:
        raise UserError(f"{key}: others may read it (mode {mode:03o}); chmod 600 mends that")
    return TlsFiles(authority=str(files[0]), certificate=str(files[1]), key=str(key))
