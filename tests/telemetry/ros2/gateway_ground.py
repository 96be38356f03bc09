"""A vehicle's side that speaks rmw_zenoh, spelled out by hand, and a gateway beside it."""

from __future__ import annotations

import contextlib
import struct
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from foretwin.contracts.foreign_bus import Arrived
from foretwin.contracts.frames import GeoPoint, LocalFrame
from foretwin.contracts.mailbox import Mailbox
from foretwin.contracts.point_cloud import Mount
from foretwin.contracts.setup import BusSetup, Ros2Setup, write_setup
from foretwin.telemetry.ros_messages.parts import ros_message, typestore
from tests.telemetry.ros2.order_side import OrderSide

ROOT = Path(__file__).resolve().parents[3]
FRAME = LocalFrame(GeoPoint(52.5, 13.4))

FIX_KEY = (
    "0/sensing/gnss/sensor_msgs::msg::dds_::NavSatFix_/"
    "RIHS01_62223ab3fe210a15976021da7afddc9e200dc9ec75231c1b6a557fc598a65404"
)
TF_KEY = "0/tf_static/tf2_msgs::msg::dds_::TFMessage_/RIHS01_x"
STEERING_KEY = "0/vehicle/steering/autoware_vehicle_msgs::msg::dds_::SteeringReport_/"
CONTROL_KEY = "0/control/cmd/autoware_control_msgs::msg::dds_::Control_/*"
ODOMETRY_KEY = "0/foretwin/twin/nav_msgs::msg::dds_::Odometry_/*"

MAPPING = """
dialect = "{dialect}"
{head}
[map]
lat_deg = 52.5
lon_deg = 13.4

[[in]]
topic = "/sensing/gnss"
type = "sensor_msgs/msg/NavSatFix"
channel = "gnss"

[[in]]
topic = "/vehicle/steering"
type = "autoware_vehicle_msgs/msg/SteeringReport"
channel = "steering"

[[in]]
topic = "/tf_static"
type = "tf2_msgs/msg/TFMessage"
channel = "transforms"

[[out]]
topic = "/foretwin/twin"
type = "nav_msgs/msg/Odometry"
source = "twin"

[[out]]
topic = "/foretwin/diagnostics"
type = "diagnostic_msgs/msg/DiagnosticArray"
source = "diagnostics"

[[out]]
topic = "/control/cmd"
type = "autoware_control_msgs/msg/Control"
source = "vehicle_command"

[[out]]
topic = "/perception/objects"
type = "autoware_perception_msgs/msg/PredictedObjects"
source = "virtual_objects"

[[out]]
topic = "/clock"
type = "rosgraph_msgs/msg/Clock"
source = "clock"
{more}
[towards_vehicle]
enabled = {enabled}
"""


def mapping_text(
    *,
    enabled: bool,
    endpoint: str | None = None,
    dialect: str = "rmw_zenoh",
    head: str = "",
    more: str = "",
) -> str:
    """Return a mapping of some topics, of `head` before them and of `more` after them."""
    head = head if endpoint is None else f'endpoint = "{endpoint}"\n{head}'
    on = "true" if enabled else "false"
    return MAPPING.format(head=head, enabled=on, dialect=dialect, more=more)


def attached(seq: int) -> bytes:
    return struct.pack("<qqB16s", seq, 5, 16, b"0123456789abcdef")


def cdr(kind: str, **fields: Any) -> bytes:
    return bytes(typestore().serialize_cdr(ros_message(kind, **fields), kind))


def ros_time(stamp_ns: int) -> Any:
    sec, nanosec = divmod(stamp_ns, 10**9)
    return typestore().types["builtin_interfaces/msg/Time"](sec=sec, nanosec=nanosec)


def steering(stamp_ns: int, angle_rad: float) -> bytes:
    return cdr(
        "autoware_vehicle_msgs/msg/SteeringReport",
        stamp=ros_time(stamp_ns),
        steering_tire_angle=angle_rad,
    )


def antenna_at(forward_m: float, left_m: float, up_m: float) -> bytes:
    """Return a TFMessage that places the frame `gnss` in base_link."""
    from tests.telemetry.autoware_messages import transform_message

    place_m = (forward_m, left_m, up_m)
    message = transform_message(0, parent="base_link", child="gnss", place_m=place_m, yaw_rad=0.0)
    return bytes(typestore().serialize_cdr(message, "tf2_msgs/msg/TFMessage"))


def fix(stamp_ns: int, lat_deg: float, lon_deg: float) -> bytes:
    import numpy as np

    types = typestore().types
    return cdr(
        "sensor_msgs/msg/NavSatFix",
        header=types["std_msgs/msg/Header"](stamp=ros_time(stamp_ns), frame_id="gnss"),
        status=types["sensor_msgs/msg/NavSatStatus"](status=0, service=1),
        latitude=lat_deg,
        longitude=lon_deg,
        altitude=40.0,
        position_covariance=np.diag([0.04, 0.04, 0.1]).ravel(),
        position_covariance_type=2,
    )


class RecordingForeign:
    """The other side in one process: what was put, and what the gateway shall find."""

    session_id = "ab12"

    def __init__(self) -> None:
        self.connected = True
        self.put_keys: list[str] = []
        self.payloads: list[bytes] = []
        self.attachments: list[bytes | None] = []
        self.tokens: list[str] = []
        self.subscribed: list[str] = []
        self.inboxes: dict[str, Mailbox] = {}

    def subscribe(self, key: str, mailbox: Mailbox, *, history: bool = False) -> None:
        self.subscribed.append(f"{key} with history" if history else key)
        self.inboxes[key.removesuffix("*/*")] = mailbox

    def put(self, key: str, payload: bytes, attachment: bytes | None = None) -> None:
        self.put_keys.append(key)
        self.payloads.append(payload)
        self.attachments.append(attachment)

    def declare_alive(self, token: str) -> None:
        self.tokens.append(token)

    def watch_alive(self, tokens: str, mailbox: Mailbox) -> None:
        raise AssertionError("the gateway watches no tokens")

    def arrive(self, key: str, payload: bytes, *, mono_ns: int, seq: int = 1) -> None:
        assert self.inboxes
        known = (box for begin, box in self.inboxes.items() if key.startswith(begin))
        inbox = next(known, next(iter(self.inboxes.values())))
        inbox.put(Arrived(key, payload, attached(seq), mono_ns, 10**18))

    def on(self, topic: str) -> list[bytes]:
        """Return the payloads that were put on a topic."""
        pairs = zip(self.put_keys, self.payloads, strict=True)
        return [payload for key, payload in pairs if key.startswith(f"0{topic}/")]


@contextlib.contextmanager
def gateway_process(
    folder: Path,
    *,
    run_endpoint: str,
    mapping: str,
    flag: bool,
    mounts: tuple[tuple[str, Mount], ...] = (),
) -> Iterator[subprocess.Popen[str]]:
    file = folder / "ros2.json"
    setup = Ros2Setup(
        run_id="r",
        process_id="ros2",
        vehicle_id="ego",
        bus=BusSetup(endpoint=run_endpoint),
        log_file=str(folder / "log.jsonl"),
        mapping=mapping,
        mapping_name="m.toml",
        drive_frame=FRAME,
        towards_vehicle=flag,
        order_keys=OrderSide("r").keys,
        mounts=mounts,
    )
    write_setup(setup, file)
    command = [sys.executable, "-m", "foretwin.telemetry.ros2", "--setup", str(file)]
    with subprocess.Popen(command, cwd=ROOT, stderr=subprocess.PIPE, text=True) as process:
        try:
            yield process
        finally:
            process.kill()
