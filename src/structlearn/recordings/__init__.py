"""Demonstrations as they come: bags and public logs in, signals on one clock out.

`read_demonstrations` is the way in for a pipeline. Below it: `bag_files` (a source -> files of any format,
each opened as a bag), `bag_recording` and `mcap_file` (one bag -> one `Recording` -> one bag), `bag_reader`,
`rosbags_reader`, `pose_table` and `bag_writer` (a file <-> raw messages), `messages`, `joint_series` and
`schemas` (ROS 2 messages <-> streams), `transforms` and `forward_kinematics` (/tf, joints -> poses), `stamps`
(what is done about stamps), `cdr` and `decoding` (raw messages <-> columns of numbers), `clock` (streams ->
one clock), `clmc`, `slide`, `panda`, `ur10e` and `text_log` (public data sets).
"""

from structlearn.recordings.bag_recording import read_recording
from structlearn.recordings.clock import synchronise
from structlearn.recordings.demonstration import Demonstration
from structlearn.recordings.folders import read_demonstrations, read_recordings, write_recordings
from structlearn.recordings.mcap_file import write_recording
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
