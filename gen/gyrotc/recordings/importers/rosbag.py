"""ROS bags of version 1 and 2 (`rosbags`): topics of inertial sensors and temperatures, message by message.

Units are those of the message definitions (REP 103 and sensor_msgs): rad/s, degrees Celsius; times are the stamps of
the headers, which the sensor's driver set.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ...common.errors import InputError
from ..tables import CHUNK_ROWS, Chunk, Column, LoggerFile, LoggerTable, library

_WHY = "the definition of {} (REP 103)"
_KINDS: dict[str, dict[str, tuple[str, str | None]]] = {
    "sensor_msgs/msg/Imu": {
        "angular_velocity.x": ("angular_velocity.x", "rad/s"),
        "angular_velocity.y": ("angular_velocity.y", "rad/s"),
        "angular_velocity.z": ("angular_velocity.z", "rad/s"),
    },
    "sensor_msgs/msg/Temperature": {"temperature": ("temperature", "degC")},
    "geometry_msgs/msg/Vector3Stamped": {
        "vector.x": ("vector.x", None),
        "vector.y": ("vector.y", None),
        "vector.z": ("vector.z", None),
    },
    "geometry_msgs/msg/TwistStamped": {
        "angular.x": ("twist.angular.x", "rad/s"),
        "angular.y": ("twist.angular.y", "rad/s"),
        "angular.z": ("twist.angular.z", "rad/s"),
    },
}
_DAMAGE_WORDS = "a whole ROS bag (a .bag, .mcap or .db3 file, or the folder with metadata.yaml)"


def open_rosbag(path: Path) -> LoggerFile:
    """A ROS bag.

    Raises:
        InputError: rosbags is not installed, or the bag is damaged.
    """
    highlevel = library(path, "rosbags.highlevel", "ros", "a ROS bag")
    where = (
        path
        if path.is_dir() or path.suffix == ".bag"
        else path.parent
        if (path.parent / "metadata.yaml").is_file()
        else path
    )
    try:
        with highlevel.AnyReader([where], default_typestore=_typestore()) as reader:
            topics = [(c.topic, c.msgtype, c.msgcount) for c in reader.connections]
    except Exception as error:  # whatever a damaged bag makes of the parser
        what = " ".join(str(error).split())[:100]
        raise InputError(path.name, f"cannot be read as ROS bag ({what})", _DAMAGE_WORDS) from error
    tables = tuple(
        BagTable(topic, _columns(kind), path=where, kind=kind, rows=count)
        for topic, kind, count in dict.fromkeys(topics)
        if kind in _KINDS
    )
    if not tables:
        held = ", ".join(f"{topic} ({kind})" for topic, kind, _ in topics[:8])
        raise InputError(path.name, f"no topic of {' or '.join(_KINDS)} among {held}", "a bag with such topics")
    return LoggerFile(path, "ROS bag", tables)


@dataclass(frozen=True)
class BagTable(LoggerTable):
    """The messages of one topic."""

    path: Path = Path()
    kind: str = ""

    def chunks(self, names: Sequence[str]) -> Iterator[Chunk]:
        """As `Table.chunks`."""
        from rosbags.highlevel import AnyReader

        fields = {name: _KINDS[self.kind][name][0].split(".") for name in names if name != "stamp"}
        first = 0
        held: dict[str, list[Any]] = {name: [] for name in ("stamp", *fields)}
        with AnyReader([self.path], default_typestore=_typestore()) as reader:
            connections = [c for c in reader.connections if c.topic == self.name]
            for connection, _, raw in reader.messages(connections):
                message: Any = reader.deserialize(raw, connection.msgtype)
                stamp = message.header.stamp
                held["stamp"].append(stamp.sec * 1_000_000_000 + stamp.nanosec)
                for name, path in fields.items():
                    value: Any = message
                    for part in path:
                        value = getattr(value, part)
                    held[name].append(value)
                if len(held["stamp"]) == CHUNK_ROWS:
                    yield _chunk(held, first, (first + CHUNK_ROWS) / max(self.rows, 1))
                    first += CHUNK_ROWS
                    held = {name: [] for name in held}
        if held["stamp"]:
            yield _chunk(held, first, 1.0)


def _chunk(held: dict[str, list[Any]], first: int, done: float) -> Chunk:
    stamps = np.array(held["stamp"], dtype=np.int64).astype("datetime64[ns]")
    values = {name: np.array(values, dtype=np.float64) for name, values in held.items() if name != "stamp"}
    return Chunk({"stamp": stamps} | values, first, min(done, 1.0))


def _columns(kind: str) -> tuple[Column, ...]:
    why = _WHY.format(kind)
    fields = (Column(name, unit, why if unit else "") for name, (_, unit) in _KINDS[kind].items())
    return (Column("stamp", "UTC", why, kind="stamp"), *fields)


def _typestore() -> Any:
    from rosbags.typesys import Stores, get_typestore

    return get_typestore(Stores.ROS2_HUMBLE)
