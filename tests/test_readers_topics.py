import pytest
import yaml
from committed import NO_TOPICS, topic_map
from pydantic import ValidationError

from structlearn.core.errors import InputError
from structlearn.core.params import read_parameters
from structlearn.readers import TopicMap


def test_roles_come_in_a_fixed_order_and_skip_what_is_not_named():
    topics = topic_map(tactile=("/finger/b", "/finger/a"), pose="/tool", joint_states=("/joints",))
    assert topics.roles() == [
        ("/tool", "pose"),
        ("/joints", "joint_states"),
        ("/finger/b", "tactile"),
        ("/finger/a", "tactile"),
    ]


def test_a_lone_topic_in_yaml_is_a_list_of_one(tmp_path):
    file = tmp_path / "params.yaml"
    some = {"pose": "/tool", "joint_states": "/joints", "tactile": ["/left", "/right"]}
    file.write_text(yaml.safe_dump({"topics": NO_TOPICS | some}))
    topics = read_parameters(file, "topics", TopicMap)
    assert topics.joint_states == ("/joints",)
    assert topics.tactile == ("/left", "/right")
    assert topics.wrench is None


@pytest.mark.parametrize(
    "fields",
    [{}, {"pose": ""}, {"pose": "/a", "tactile": [""]}, {"pose": "/a", "twists": "/b"}, {"pose": None}],
)
def test_pose_is_required_and_names_are_not_empty(fields):
    with pytest.raises(ValidationError):
        topic_map(**fields)


def test_a_topic_is_named_once(tmp_path):
    with pytest.raises(ValidationError, match="topic named more than once: /a"):
        topic_map(pose="/a", wrench="/a")
    file = tmp_path / "params.yaml"
    file.write_text(yaml.safe_dump({"topics": NO_TOPICS | {"pose": "/a", "twist": "/a"}}))
    with pytest.raises(InputError, match=r"params\.yaml: topics: .*more than once: /a"):
        read_parameters(file, "topics", TopicMap)
