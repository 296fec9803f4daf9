"""Demonstrations as they come: bags and public logs in, signals on one clock out.

`read_demonstrations` is the way in for a pipeline. Below it: `mcap_file` (one bag <-> one `Recording`),
`bag_reader` and `bag_writer` (a bag <-> raw messages), `messages` and `schemas` (ROS 2 messages <-> streams),
`cdr` (raw messages <-> columns of numbers), `clock` (streams -> one clock), `clmc`, `slide`, `panda`,
`ur10e` and `text_log` (public data sets).
"""

from structlearn.recordings.clock import synchronise
from structlearn.recordings.demonstration import Demonstration
from structlearn.recordings.folders import read_demonstrations, read_recordings, write_recordings
from structlearn.recordings.mcap_file import read_recording, write_recording
from structlearn.recordings.recording import Recording, Stream
from structlearn.recordings.stamps import StampPolicy
from structlearn.recordings.topics import OWN_TOPICS, TopicMap

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
