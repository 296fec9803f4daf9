import re

import pytest
import yaml
from pydantic import Field, ValidationError

from structlearn.ground.errors import InputError
from structlearn.ground.params import Parameters, read_parameters
from structlearn.testbeds.scraping.world.testbed import TestbedParameters


class FilterParameters(Parameters):
    cutoff_hz: float = Field(gt=0)


class SegmentParameters(Parameters):
    extension_s: float = Field(gt=0)
    count: int = Field(default=3, ge=1)
    filter: FilterParameters = FilterParameters(cutoff_hz=5.0)


def read(tmp_path, text):
    path = tmp_path / "params.yaml"
    path.write_text(text)
    return read_parameters(path, "segment", SegmentParameters)


def complaint(tmp_path, text):
    with pytest.raises(InputError) as error:
        read(tmp_path, text)
    message = str(error.value)
    assert message.startswith(f"{tmp_path / 'params.yaml'}: ")
    return message.removeprefix(f"{tmp_path / 'params.yaml'}: ")


def test_values_are_read_and_frozen(tmp_path):
    found = read(tmp_path, "other: {unknown: 1}\nsegment:\n  extension_s: 0.5\n  filter: {cutoff_hz: 2}\n")
    assert found == SegmentParameters(extension_s=0.5, filter=FilterParameters(cutoff_hz=2.0))
    with pytest.raises(ValidationError, match="frozen"):
        found.extension_s = 1.0


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("segment: {extension_s: 1, extent: 2}", "segment.extent: unknown parameter"),
        (
            "segment: {extension_s: 1, filter: {cutoff_hz: 1, order: 2}}",
            "segment.filter.order: unknown parameter",
        ),
        ("segment: {extension_s: -1}", "segment.extension_s: Input should be greater than 0 (got -1)"),
        (
            "segment: {extension_s: 1, filter: {cutoff_hz: 0}}",
            "segment.filter.cutoff_hz: Input should be greater than 0 (got 0)",
        ),
        ("segment: {extension_s: .nan}", "segment.extension_s: Input should be a finite number (got nan)"),
        ("segment: {extension_s: .inf}", "segment.extension_s: Input should be a finite number (got inf)"),
        ("segment: {extension_s: -.inf}", "segment.extension_s: Input should be a finite number (got -inf)"),
        ("other: {}", "key 'segment' is missing"),
        ("", "key 'segment' is missing"),
        ("- a list", "key 'segment' is missing"),
    ],
)
def test_a_wrong_value_is_named_with_its_file_and_dotted_key(tmp_path, text, expected):
    assert complaint(tmp_path, text) == expected


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("segment: {extension_s: long}", "segment.extension_s: .*valid number.* \\(got 'long'\\)"),
        ("segment: {extension_s: 1, count: 1.5}", "segment.count: .*valid integer.* \\(got 1.5\\)"),
        ("segment: {}", "segment.extension_s: Field required"),
        ("segment:", "segment: .*\\(got None\\)"),
        ("segment: {extension_s: -1, count: 0}", "segment.extension_s: .*; segment.count: .*"),
        ("segment: [1, 2", "not a YAML file: "),
        ("segment: {extension_s: 1}\n  bad: indent", "not a YAML file: "),
    ],
)
def test_every_fault_has_its_own_phrase(tmp_path, text, expected):
    assert re.match(expected, complaint(tmp_path, text), re.DOTALL)


def test_a_binary_file_is_not_yaml(tmp_path):
    path = tmp_path / "params.yaml"
    path.write_bytes(b"PAR1\x80\x81\xff")
    with pytest.raises(InputError, match=r"params\.yaml: not a YAML file"):
        read_parameters(path, "segment", SegmentParameters)


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(InputError, match=r"nowhere\.yaml: no such parameter file"):
        read_parameters(tmp_path / "nowhere.yaml", "segment", SegmentParameters)


def test_yaml_cannot_run_code(tmp_path):
    assert complaint(tmp_path, "segment: !!python/object/apply:os.getcwd []").startswith("not a YAML file")


def listed(model: type[Parameters]) -> dict:
    """Names of all parameters of a model, nested."""
    fields = {name: field.annotation for name, field in model.model_fields.items()}
    return {
        name: listed(kind) if isinstance(kind, type) and issubclass(kind, Parameters) else None
        for name, kind in fields.items()
    }


def test_every_constant_of_the_simulated_testbed_stands_in_the_parameter_file(root):
    written = yaml.safe_load((root / "params.yaml").read_text())["testbed"]
    names = listed(TestbedParameters)
    assert names.keys() == written.keys()
    for part, inner in names.items():
        if inner is not None:
            assert inner.keys() == written[part].keys(), part
