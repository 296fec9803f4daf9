import pytest
from pydantic import ValidationError

from structlearn.ground.errors import InputError
from structlearn.ground.params import read_parameters
from structlearn.recordings import OWN_TOPICS, TopicMap


def test_roles_come_in_a_fixed_order_and_skip_what_is_not_named():
    topics = TopicMap(tactile=("/finger/b", "/finger/a"), pose="/tool", joint_states=("/joints",))
    assert topics.roles() == [
        ("/tool", "pose"),
        ("/joints", "joint_states"),
        ("/finger/b", "tactile"),
        ("/finger/a", "tactile"),
    ]


def test_a_lone_topic_in_yaml_is_a_list_of_one(tmp_path):
    file = tmp_path / "params.yaml"
    file.write_text("topics:\n  pose: /tool\n  joint_states: /joints\n  tactile: [/left, /right]\n")
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
        TopicMap(**fields)


def test_a_topic_is_named_once(tmp_path):
    with pytest.raises(ValidationError, match="topic named more than once: /a"):
        TopicMap(pose="/a", wrench="/a")
    file = tmp_path / "params.yaml"
    file.write_text("topics: {pose: /a, twist: /a}\n")
    with pytest.raises(InputError, match=r"params\.yaml: topics: .*more than once: /a"):
        read_parameters(file, "topics", TopicMap)


def test_own_topics_may_be_absent():
    assert not OWN_TOPICS.must_exist
    assert TopicMap(pose="/a").must_exist
