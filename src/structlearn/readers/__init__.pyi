from .bag_recording import (
    read_demonstrations as read_demonstrations,
    read_recording as read_recording,
    read_recordings as read_recordings,
    write_recording as write_recording,
    write_recordings as write_recordings,
)
from .clock import synchronise as synchronise
from .demonstration import Demonstration as Demonstration, Recording as Recording, Stream as Stream
from .source import StampPolicy as StampPolicy
from .source import OWN_TOPICS as OWN_TOPICS, TopicMap as TopicMap
