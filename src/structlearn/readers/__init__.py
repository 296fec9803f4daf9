"""Readers of demonstrations: bags and public logs in, signals on one clock out.

Pipelines call `read_demonstrations`. Below it: `source` (a source -> its files), `bag` and `user_tables` (a
file <-> raw messages), `cdr`, `messages`, `joint_log` and `computed_pose` (raw messages <-> streams), `clock`
(streams -> one clock). Stages exchange sets as tables: runs (`demonstration`), or `joint_log` without poses.
The public names are in the stub beside this file; their modules load on first use.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
