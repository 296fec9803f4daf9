"""Libraries are pinned before they are loaded, in stages and workers, and nowhere else."""

import os
import subprocess
import sys

import numpy as np
import pytest
import torch
from threadpoolctl import threadpool_limits

from structlearn.core import processor
from structlearn.networks.torch_settings import square_root

pytestmark = pytest.mark.skipif(not processor.pinned(), reason="not an x86-64 with AVX2, or not wanted")

OF_USER = {"OMP_NUM_THREADS": "2", "NPY_ENABLE_CPU_FEATURES": "AVX512_SKX"}  # gives way


def run(*words, script="", cwd=None, code=0, **variables):
    """What a program prints in a shell without pins."""
    kept = {name: value for name, value in os.environ.items() if name not in processor.PINS}
    done = subprocess.run(
        [sys.executable, *words], input=script, cwd=cwd, env=kept | variables, capture_output=True, text=True
    )
    assert done.returncode == code, done.stderr
    return done.stderr if code else done.stdout


def test_this_process_is_pinned():
    assert processor.deviations() == ""
    with threadpool_limits(2):
        assert "openblas uses 2 threads" in processor.deviations()


LOADED = """
import torch, scipy.linalg, numba
from structlearn.core import processor
print(processor.pinned(), processor.deviations() or "-", "AVX512" in torch.backends.cpu.get_cpu_capability())
"""


@pytest.mark.parametrize("package", ["dissertation", "structlearn.tasks.stages"])
def test_the_reproduction_and_stages_of_tasks_pin_whatever_the_caller_has_set(package):
    assert run("-c", f"import {package}\n{LOADED}", **OF_USER) == "True - False\n"
    assert run("-c", f"import {package}\n{LOADED}", STRUCTLEARN_BITS="native").startswith("False - ")


def test_a_robot_and_users_of_the_library_are_not_pinned():
    script = "import structlearn, structlearn.feedback as feedback; feedback.Controller\n"
    script += "from structlearn.core import stage, processor; stage.run(lambda: None, stage=False)\n"
    script += "print(processor.pinned())"
    assert run("-c", script) == "False\n"


STAGE = """
import sys, os
print("begins", flush=True)
import numpy
from structlearn.core.stage import run
from structlearn.core.processor import deviations
run(lambda: print(sys.argv[1:], deviations() or "-"))
"""


@pytest.mark.parametrize("words", [["late.py"], ["-m", "late"], ["-c", STAGE], ["-W", "ignore", "late.py"]])
def test_a_stage_that_loaded_numpy_too_early_starts_again_once(tmp_path, words):
    (tmp_path / "late.py").write_text(STAGE)
    assert run(*words, "--task", "a b", cwd=tmp_path) == "begins\nbegins\n['--task', 'a b'] -\n"
    assert run(*words, "pour", cwd=tmp_path, STRUCTLEARN_BITS="native") == "begins\n['pour'] -\n"
    assert run(*words, "pour", cwd=tmp_path, **processor.PINS) == "begins\n['pour'] -\n"


def test_what_cannot_start_again_or_is_misspelt_is_one_line(tmp_path):
    said = run("-", script=STAGE, cwd=tmp_path, code=1)
    assert said.startswith("error: numpy was loaded before it was pinned")
    assert said.endswith("set the variables that `python -m structlearn.core.processor` prints\n")
    said = run("-c", STAGE, cwd=tmp_path, code=1, STRUCTLEARN_BITS="naitive")
    assert said == "error: STRUCTLEARN_BITS=naitive: is not native\n"


def test_the_variables_for_a_shell_are_those_of_a_stage():
    lines = run("-m", "structlearn.core.processor").splitlines()
    assert dict(line.removeprefix("export ").split("=", 1) for line in lines) == processor.PINS


def test_a_processor_without_these_instructions_is_warned_of_and_left_alone(monkeypatch, capsys):
    monkeypatch.setattr(processor, "_has_avx2", lambda: False)
    for name in processor.PINS:
        monkeypatch.delenv(name)
    processor.require_pins()
    assert not processor.pinned()  # OpenBLAS would end with an illegal instruction
    said = (
        "warning: this is not an x86-64 processor with AVX2: last digits will differ from those of others\n"
    )
    assert capsys.readouterr() == ("", said)


def test_libraries_that_cannot_be_pinned_are_named_after_one_start(monkeypatch, capsys):
    """As other versions, which do not know the variables."""
    monkeypatch.setattr(processor, "_of_kernels", lambda: iter(["numpy uses AVX512_SKX"]))
    monkeypatch.setenv(processor.STARTED_AGAIN, str(os.getpid()))
    processor.require_pins()
    assert capsys.readouterr().err.startswith("warning: numpy uses AVX512_SKX: last digits")


def test_a_square_root_without_estimates_is_one_also_for_gradients():
    values = torch.logspace(-30, 30, 401, dtype=torch.float64, requires_grad=True)
    roots = square_root(values)
    (slopes,) = torch.autograd.grad(roots.sum(), values)
    expected = np.sqrt(values.detach().numpy())
    np.testing.assert_allclose(roots.detach(), expected, rtol=4e-16)
    np.testing.assert_allclose(slopes, 0.5 / expected, rtol=1e-15)
