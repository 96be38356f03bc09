"""Names of ROS 2 on Zenoh: keys of topics, liveliness tokens, QoS, type hashes.

rmw_zenoh: `<domain>/<topic>/<pkg>::msg::dds_::<Type>_/<hash>`; its tokens begin with `@ros2_lv`
(rmw_zenoh's design document). zenoh-bridge-ros2dds: `[namespace/]topic`, without type or token.
"""

from __future__ import annotations

import functools
import re
from typing import Literal, NamedTuple

import msgspec

from foretwin.telemetry.ros_messages.parts import typestore

Dialect = Literal["rmw_zenoh", "ros2dds"]
EntityKind = Literal["NN", "MP", "MS", "SS", "SC"]
"""Node, publisher, subscriber, service, client."""

_TOKEN_ROOT = "@ros2_lv"
_TOPIC = re.compile(r"(/[A-Za-z_][A-Za-z0-9_]*)+")
_TYPE = re.compile(r"([a-z][a-z0-9_]*)/msg/([A-Z][A-Za-z0-9]*)")
_DDS_TYPE = re.compile(r"([a-z][a-z0-9_]*)::msg::dds_::([A-Z][A-Za-z0-9]*)_")


class TopicKey(NamedTuple):
    """What a key of rmw_zenoh says."""

    domain: int
    topic: str
    kind: str
    type_hash: str


class Entity(msgspec.Struct, frozen=True, kw_only=True):
    """A node, or an end of a topic at a node, as a liveliness token announces it."""

    domain: int
    session: str
    node_id: int
    entity_id: int
    entity: EntityKind
    namespace: str
    node: str
    topic: str | None = None
    kind: str | None = None
    transient_local: bool = False
    """Whether it keeps what was said for those that come later; the rest is ROS's default."""


def check_topic(topic: str) -> str:
    """Return `topic`; raises ValueError where it is no absolute ROS topic name."""
    if _TOPIC.fullmatch(topic) is None:
        raise ValueError(f"topic {topic!r}: an absolute ROS name such as /sensing/gnss/fix")
    return topic


def dds_type(kind: str) -> str:
    """Return `sensor_msgs::msg::dds_::Imu_` of `sensor_msgs/msg/Imu`; raises ValueError."""
    found = _TYPE.fullmatch(kind)
    if found is None:
        raise ValueError(f"type {kind!r}: a full name such as sensor_msgs/msg/Imu")
    return f"{found[1]}::msg::dds_::{found[2]}_"


def ros_kind(dds: str) -> str:
    """Return `sensor_msgs/msg/Imu` of `sensor_msgs::msg::dds_::Imu_`; raises ValueError."""
    found = _DDS_TYPE.fullmatch(dds)
    if found is None:
        raise ValueError(f"type {dds!r}: of the form sensor_msgs::msg::dds_::Imu_")
    return f"{found[1]}/msg/{found[2]}"


@functools.cache
def type_hash(kind: str) -> str:
    """Return `RIHS01_…` of a known type (REP-2016); raises ValueError for an unknown one."""
    store = typestore()
    if kind not in store.types:
        raise ValueError(f"type {kind!r} is not known")
    return str(store.hash_rihs01(kind))


def rmw_key(topic: str, kind: str, *, domain: int, type_hash: str) -> str:
    """Return the key on which rmw_zenoh publishes."""
    return f"{domain}/{check_topic(topic).strip('/')}/{dds_type(kind)}/{type_hash}"


def rmw_any_type_key(topic: str, *, domain: int) -> str:
    """Return the expression of all keys of a topic, so that a change of its type is seen."""
    return f"{domain}/{check_topic(topic).strip('/')}/*/*"


def parse_rmw_key(key: str) -> TopicKey:
    """Return what a key of rmw_zenoh says; raises ValueError for another key."""
    parts = key.split("/")
    if len(parts) < 4 or not parts[0].isdecimal():
        raise ValueError(f"key {key!r}: not of the form <domain>/<topic>/<type>/<hash>")
    topic = check_topic("/" + "/".join(parts[1:-2]))
    return TopicKey(int(parts[0]), topic, ros_kind(parts[-2]), parts[-1])


def bridge_key(topic: str, *, namespace: str = "/") -> str:
    """Return the key of zenoh-bridge-ros2dds; `namespace` is the bridge's own."""
    parts = (namespace.strip("/"), check_topic(topic).strip("/"))
    return "/".join(part for part in parts if part)


def qos_text(*, transient_local: bool) -> str:
    """Return a QoS profile as in a token: reliable, ten deep, what is the default left empty.

    `reliability:durability:history,depth:deadline:lifespan:liveliness,lease`.
    """
    return f":{'1' if transient_local else ''}:,10:,:,:,,"


def token(entity: Entity) -> str:
    """Return the liveliness token of an entity."""
    at = f"{_TOKEN_ROOT}/{entity.domain}/{entity.session}/{entity.node_id}/{entity.entity_id}"
    node = f"{at}/{entity.entity}/%/{_mangled(entity.namespace)}/{entity.node}"
    if entity.topic is None:
        return node
    assert entity.kind is not None
    topic, kind = _mangled(check_topic(entity.topic)), dds_type(entity.kind)
    digest, qos = type_hash(entity.kind), qos_text(transient_local=entity.transient_local)
    return f"{node}/{topic}/{kind}/{digest}/{qos}"


def _mangled(name: str) -> str:
    return name.replace("/", "%")
