"""Who may say what on a bus: Zenoh's access rules, made from the table of channels.

All is denied that no row allows. The rules hold for what comes into the router: what somebody may
not say reaches nobody, and who may not listen has no subscription. Nothing is asked again on the
way out.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, Literal, NamedTuple, get_args

from foretwin.contracts.keys import ALIVE_KEY, CHANNELS, PREFIX, BusRole, Channel, Writer
from foretwin.contracts.lives import key_of_life

SubjectKind = Literal["usernames", "cert_common_names"]
"""By what a router knows its clients: passwords, or certificates."""

_MESSAGES = (
    "put", "delete", "declare_subscriber", "query", "reply", "declare_queryable",
    "liveliness_token", "liveliness_query", "declare_liveliness_subscriber",
)  # fmt: skip
_EVERYTHING = ("**", "**/@adv/**")
"""What publishers keep for who missed it lies under a key that no `**` matches."""
_HEARS: dict[BusRole, tuple[str, ...]] = {
    "planner": (CHANNELS["planner_scene"].key, CHANNELS["run_end"].key),
    "operator": (CHANNELS["state"].key,),
}
"""Of roles that hear no more; others hear all of the run and of vehicles."""
_ALL = (f"{PREFIX}/run/**", f"{PREFIX}/vehicle/**")
_ANY = {"run": "*", "process": "*", "vehicle": "*"}
"""Whoever listens may do so before it knows which run there is."""


class BusMember(NamedTuple):
    """Somebody on a bus: what the router knows it by, and the ids that its keys are bound to."""

    name: str
    role: BusRole
    process_id: str = "*"
    vehicle_id: str = "*"
    beside: tuple[str, ...] = ()
    """Further processes that may join as this one."""


def access_control(
    members: Iterable[BusMember], *, subject: SubjectKind, run_id: str = "*"
) -> dict[str, Any]:
    """Return Zenoh's `access_control`, complete."""
    rules: list[dict[str, Any]] = [_rule("out", _MESSAGES, _EVERYTHING, flow="egress")]
    subjects, policies = [], []
    for member in members:
        mine = [
            _rule(f"{member.name} {what}", messages, keys)
            for what, messages, keys in _allowed(member, run_id)
            if keys
        ]
        rules += mine
        subjects.append({"id": member.name, subject: [member.name]})
        ids = ["out", *(rule["id"] for rule in mine)]
        policies.append({"rules": ids, "subjects": [member.name]})
    return {
        "enabled": True,
        "default_permission": "deny",
        "rules": rules,
        "subjects": subjects,
        "policies": policies,
    }


def role_of(name: str) -> BusRole | None:
    """Return the role of a member by its name, which begins with it; None where it has none."""
    roles: tuple[BusRole, ...] = get_args(BusRole)
    return next((role for role in roles if name == role or name.startswith(f"{role}-")), None)


def may_say(member: BusMember, channel: Channel) -> bool:
    """Whether somebody may publish on a channel, or ask."""
    return any(_is(member, writer) for writer in channel.writers)


def _is(member: BusMember, writer: Writer) -> bool:
    named = writer.process is None or member.process_id in ("*", writer.process)
    return member.role == writer.role and named


def _allowed(member: BusMember, run_id: str) -> list[tuple[str, tuple[str, ...], list[str]]]:
    """Return what somebody may do, with which of Zenoh's messages, on which keys."""
    channels = CHANNELS.values()
    said = [one for one in channels if may_say(member, one)]
    # The orchestrator and a planner speak to every process, who reads reads every vehicle.
    speaks = {
        "run": run_id,
        "process": "*" if member.role in ("orchestrator", "planner") else member.process_id,
        "vehicle": member.vehicle_id if member.role == "car" else "*",
    }
    own = speaks | {"process": member.process_id}
    kept = [] if member.role in _HEARS else [one for one in channels if one.qos.kept_s]
    return [
        ("says", ("put",), _keys((one for one in said if one.reply is None), speaks)),
        ("asks", ("query",), _keys((one for one in said if one.reply is not None), speaks)),
        (
            "answers",
            ("declare_queryable", "reply"),
            _keys((one for one in channels if one.server == member.role), own),
        ),
        (
            "keeps",
            ("put", "declare_queryable", "reply", "liveliness_token"),
            _keys((one for one in said if one.qos.kept_s), speaks, below="/@adv/**"),
        ),
        # What is kept is given again under the key on which it was said.
        ("gives again", ("reply",), _keys((one for one in said if one.qos.kept_s), speaks)),
        (
            "catches up",
            ("query", "declare_subscriber", "liveliness_query", "declare_liveliness_subscriber"),
            _keys(kept, _ANY, below="/@adv/**"),
        ),
        (
            "hears",
            ("declare_subscriber",),
            [one.format(**_ANY) for one in _HEARS.get(member.role, _ALL)],
        ),
        (
            "is alive",
            ("liveliness_token",),
            []
            if member.role in _HEARS
            else [
                key_of_life(ALIVE_KEY.format(**own | {"process": one}), "**")
                for one in (member.process_id, *member.beside)
            ],
        ),
        (
            "sees who is",
            ("liveliness_query", "declare_liveliness_subscriber"),
            [key_of_life(ALIVE_KEY.format(**_ANY), "**")],
        ),
    ]


def _keys(channels: Iterable[Channel], ids: dict[str, str], *, below: str = "") -> list[str]:
    return [one.key.format(**ids) + below for one in channels]


def _rule(
    name: str, messages: tuple[str, ...], keys: Iterable[str], *, flow: str = "ingress"
) -> dict[str, Any]:
    return {
        "id": name,
        "messages": list(messages),
        "flows": [flow],
        "permission": "allow",
        "key_exprs": list(keys),
    }
