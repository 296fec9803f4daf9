"""Bags of the older storage of ROS 2 (.db3) and of ROS 1 (.bag), read by the library `rosbags`.

The library is an extra of this package, since most have MCAP. Messages of ROS 1 become those of ROS 2: the
same numbers in CDR, headers without their counter.
"""

from collections.abc import Collection, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from mcap.records import Schema
from mcap.well_known import SchemaEncoding

from structlearn.core.errors import InputError
from structlearn.readers.bag import Bag, Budget, Row, in_time_order, unpacked_file

HEADER = "std_msgs/msg/Header"


def read_db3(path: Path, topics: Collection[str]) -> Bag:
    """Read a .db3 file; files older than ROS 2 Iron lack definitions, those of the library stand in.

    Raises:
        InputError: `rosbags` is not installed, or the file is missing or damaged; the message names it.
    """
    with _library_named(path), unpacked_file(path, budget := Budget(path)) as plain:
        from rosbags.highlevel import AnyReader
        from rosbags.typesys import Stores, get_typestore

        latest = get_typestore(Stores.LATEST)
        with AnyReader([plain], default_typestore=latest) as reader:
            return _bag(reader, topics, (reader.typestore, latest), lambda raw, kind: budget.message(raw))


def read_ros1_bag(path: Path, topics: Collection[str]) -> Bag:
    """Read a .bag file of ROS 1; raises as `read_db3`."""
    with _library_named(path):
        from rosbags.rosbag1 import Reader
        from rosbags.typesys import Stores, get_types_from_msg, get_typestore

        with Reader(path) as reader:
            types: dict[str, Any] = {}
            for connection in reader.connections:
                types |= get_types_from_msg(connection.msgdef.data, connection.msgtype)
            if HEADER in types:  # with the counter, messages could not be turned into those of ROS 2
                types[HEADER] = get_typestore(Stores.LATEST).fielddefs[HEADER]
            store = get_typestore(Stores.EMPTY)
            store.register(types)
            return _bag(reader, topics, (store,), store.ros1_to_cdr)


@contextmanager
def _library_named(path: Path) -> Iterator[None]:
    """Turn whatever the library raises into an InputError that names the file; only its calls go inside."""
    try:
        yield
    except ModuleNotFoundError as error:
        if (error.name or "").partition(".")[0] != "rosbags":
            raise
        raise InputError(
            f"{path}: bags of this kind are read by `rosbags`, which is not installed: `make own` installs "
            "it, or `pip install structlearn[bags]`; or `ros2 bag convert` turns the bag into MCAP"
        ) from error
    except InputError:
        raise
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror or error}") from error
    except Exception as error:
        raise InputError(f"{path}: damaged bag: {type(error).__name__}: {error}") from error


def _bag(reader: Any, topics: Collection[str], stores: Collection[Any], to_cdr: Any) -> Bag:
    """Content of an open reader; `stores` know the types, `to_cdr` turns content and type into CDR."""
    present: dict[str, list[str]] = {}
    for connection in reader.connections:
        types = present.setdefault(connection.topic, [])
        types += [connection.msgtype] * (connection.msgtype not in types)
    wanted = [connection for connection in reader.connections if connection.topic in topics]
    schemas = {name: _schema(name, stores) for name in dict.fromkeys(one.msgtype for one in wanted)}
    rows: dict[str, list[Row]] = {}
    for connection, log_time, raw in reader.messages(connections=wanted) if wanted else ():
        row = (log_time, schemas[connection.msgtype], bytes(to_cdr(raw, connection.msgtype)))
        rows.setdefault(connection.topic, []).append(row)
    return Bag(present, None, {topic: in_time_order(its) for topic, its in rows.items()})


def _schema(name: str, stores: Collection[Any]) -> Schema:
    store = next((store for store in stores if name in store.fielddefs), None)
    if store is None:
        raise LookupError(f"the type {name} is not defined")
    text, _ = store.generate_msgdef(name, ros_version=2)
    return Schema(id=0, name=name, encoding=SchemaEncoding.ROS2, data=text.encode())
