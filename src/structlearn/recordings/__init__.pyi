from .bag_recording import (
    read_demonstrations as read_demonstrations,
    read_recording as read_recording,
    read_recordings as read_recordings,
    write_recording as write_recording,
    write_recordings as write_recordings,
)
from .clock import synchronise as synchronise
from .demonstration import Demonstration as Demonstration
from .joint_log import (
    JointLog as JointLog,
    read_joint_log as read_joint_log,
    read_joint_logs as read_joint_logs,
)
from .recording import (
    Recording as Recording,
    Stream as Stream,
)
from .runs import (
    read_runs as read_runs,
    write_runs as write_runs,
)
from .stamps import StampPolicy as StampPolicy
from .topics import (
    OWN_TOPICS as OWN_TOPICS,
    TopicMap as TopicMap,
)
