"""Demonstrations as they come: bags and public logs in, signals on one clock out.

`read_demonstrations` is the way in for a pipeline. Below it: `source` (a source -> files of any format),
`bag` and `user_tables` (a file <-> raw messages), `cdr`, `messages`, `joint_log` and `computed_pose` (raw
messages <-> streams), `clock` (streams -> one clock). Stages hand sets on as tables: `runs`, and `joint_log`
where no pose was recorded.
"""

from structlearn.readers.bag_recording import (
    read_demonstrations,
    read_recording,
    read_recordings,
    write_recording,
    write_recordings,
)
from structlearn.readers.clock import synchronise
from structlearn.readers.demonstration import Demonstration, Recording, Stream
from structlearn.readers.source import OWN_TOPICS, StampPolicy, TopicMap

__all__ = [
    "OWN_TOPICS",
    "Demonstration",
    "Recording",
    "StampPolicy",
    "Stream",
    "TopicMap",
    "read_demonstrations",
    "read_recording",
    "read_recordings",
    "synchronise",
    "write_recording",
    "write_recordings",
]
