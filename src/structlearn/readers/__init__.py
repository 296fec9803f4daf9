"""Demonstrations as they come: bags and public logs in, signals on one clock out.

`read_demonstrations` is the way in for a pipeline. Below it: `source` (a source -> files of any format),
`bag` and `user_tables` (a file <-> raw messages), `cdr`, `messages`, `joint_log` and `computed_pose` (raw
messages <-> streams), `clock` (streams -> one clock). Stages hand sets on as tables: `runs`, and `joint_log`
where no pose was recorded. What users import stands in the stub beside this file, and is loaded when it is
first used.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
