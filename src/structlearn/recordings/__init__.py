"""Demonstrations as they come: bags and public logs in, signals on one clock out.

`read_demonstrations` is the way in for a pipeline. Below it: `bag_files` (a source -> files of any format),
`bag`, `rosbags_reader` and `pose_table` (a file <-> raw messages), `messages`, `joint_series`, `transforms`
and `forward_kinematics` (raw messages <-> streams), `clock` (streams -> one clock). Stages hand sets on as
tables: `runs`, and `joint_log` where nobody recorded a pose.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
