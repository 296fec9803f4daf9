import pytest
from pydantic import ValidationError

from structlearn.core.errors import InputError
from structlearn.core.params import Parameters
from structlearn.readers.source import Setting, setting_label
from structlearn.tasks.task_import import setting_folders


class Own(Parameters):
    settings: tuple[Setting, ...]


@pytest.mark.parametrize(
    ("written", "label"),
    [
        *((one, "5") for one in ("5", "5.0", 5, 5.0, "5.00", "+5")),
        *((one, "-2.5") for one in ("-2.5", -2.5, "-2.50")),
        ("tilt_left", "tilt_left"),
        ("-0", "0"),
        ("6.3", "6.3"),
        ("nan", "nan"),
    ],
)
def test_numbers_are_one_setting_however_they_are_written(written, label):
    assert setting_label(written) == label
    assert Own(settings=[written]).settings == (label,)


@pytest.mark.parametrize("wrong", [True, None, [5], "../5", "", "=5"])
def test_what_is_no_label_is_refused(wrong):
    with pytest.raises(ValidationError):
        Own(settings=[wrong])


def folders(root, *names):
    for name in names:
        (root / name).mkdir()
    return root


def test_folders_come_by_label_those_that_are_named_first(tmp_path):
    found = setting_folders(folders(tmp_path, "10", "5.0", "tilt_left", ".git", "7.5"), ["tilt_left", "5"])
    assert list(found) == ["tilt_left", "5", "10", "7.5"]
    assert found["5"] == tmp_path / "5.0"


def test_a_setting_that_is_named_and_not_recorded_is_an_error(tmp_path):
    folders(tmp_path, "5", "tilt_left")
    with pytest.raises(InputError, match="nothing was recorded in the setting 6, up; there are 5, tilt_left"):
        setting_folders(tmp_path, ["5", "6", "up"])
    with pytest.raises(InputError, match="nowhere: no such folder"):
        setting_folders(tmp_path / "nowhere", [])


def test_two_folders_of_one_setting_are_an_error(tmp_path):
    folders(tmp_path, "5", "5.0")
    with pytest.raises(InputError, match=r"5\.0: the setting 5 has another folder, 5, too"):
        setting_folders(tmp_path, ["5"])
