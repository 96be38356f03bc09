"""The command line of a campaign's certificates, and of what keeps somebody from a bus."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from foretwin.orchestrator.commands.cli_help import CommandGroup
from foretwin.orchestrator.commands.told import CommandResult, told

secure = CommandGroup(
    help="Certificates for a bus over a network: who may join, and as what (docs/security.md).",
    no_args_is_help=True,
)

FolderOption = Annotated[
    Path, typer.Option("--folder", help="the campaign's folder, its owner's alone")
]
HostOption = Annotated[
    list[str] | None,
    typer.Option("--host", help="name or address at which the router is reached; may be repeated"),
]


@secure.command("init")
@told
def init(
    folder: FolderOption,
    host: HostOption = None,
    campaign_days: Annotated[int, typer.Option(help="how long the campaign goes on")] = 30,
    days: Annotated[int, typer.Option(help="how long a role's certificate holds")] = 7,
) -> CommandResult:
    """Begin a campaign: an authority of its own, and certificates for a drive's processes.

    Example: foretwin secure init --folder CAMPAIGN --host 192.168.7.2
    """
    from foretwin.orchestrator.commands.secure import begin

    return begin(folder, hosts=host or (), days=campaign_days, role_days=days)


@secure.command("add")
@told
def add(
    role: Annotated[
        str,
        typer.Argument(
            metavar="ROLE", help="car, planner, operator, worker-NAME, or any to renew it"
        ),
    ],
    folder: FolderOption,
    host: HostOption = None,
    days: Annotated[int, typer.Option(help="how long the certificate holds")] = 7,
) -> CommandResult:
    """Make or renew a role's certificate; its folder is what its host needs.

    Example: foretwin secure add worker-boot --folder CAMPAIGN
    """
    from foretwin.orchestrator.commands.secure import add as add_role

    return add_role(folder, role, hosts=host or (), days=days)


@secure.command("show")
@told
def show(folder: FolderOption) -> CommandResult:
    """Say for how long each certificate holds, and what is wrong with any.

    Example: foretwin secure show --folder CAMPAIGN
    """
    from foretwin.orchestrator.commands.secure import show as show_roles

    return show_roles(folder)


@told
def doctor(
    endpoint: Annotated[
        str | None, typer.Option(help="tls/HOST:PORT of a drive that lets nobody in")
    ] = None,
    secure: Annotated[
        Path | None, typer.Option(help="the campaign's folder, or that of one role")
    ] = None,
    role: Annotated[str, typer.Option(help="who is not let in")] = "car",
) -> CommandResult:
    """Say what this machine has and what is missing, or why a bus lets one of its roles not in.

    Example: foretwin doctor
    """
    from foretwin.orchestrator.commands.doctor import examine, examine_bus

    if endpoint is None and secure is None:
        return examine()
    return examine_bus(endpoint, secure, role=role)
