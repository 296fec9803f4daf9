"""Readers of demonstrations: bags and public logs in, signals on one clock out.

Pipelines call `read_demonstrations` (`bag_recording`), which takes these steps, in this order:

| step | module |
|---|---|
| source -> files | `source_files` (place, stamps and topics of a source: `source`) |
| file -> raw messages of the named topics | `raw_messages`; `user_tables` if it is a table |
| raw -> decoded messages | `decoded_messages` |
| decoded messages -> streams | `messages`, `joint_streams`; `computed_pose` if none is published |
| streams -> one clock | `clock` |
| runs on it, as stages exchange them | `demonstration`; without poses `joint_log`, `touch_log` |

`lerobot` and the public sets' readers start from `foreign_tables` instead and end in the same streams. The
public names are in the stub beside this file; their modules load on first use.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
