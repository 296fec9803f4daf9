import numpy as np
import pytest
import torch
from committed import committed
from rigid_body_motions import arm, rubbing_motion

from structlearn.ground.artefacts import write_tensors
from structlearn.ground.errors import InputError
from structlearn.ground.metrics import nmse
from structlearn.rigid_body.dynamics_models import (
    DynamicsModels,
    predicted_torques,
    read_dynamics_models,
    write_dynamics_models,
)
from structlearn.rigid_body.learner import KINDS, LearningParameters, Lesson, learner

FRICTION = ("viscous", "offset")
PARAMETERS = committed(LearningParameters, "train_dynamics.learning", hidden=(8, 6))


def trained(kind):
    """Two models after some steps: the models, and the errors that their training had."""
    group = learner(kind, Lesson(arm().tree, rubbing_motion(arm()), FRICTION), "raw", (0, 1), PARAMETERS)
    group.learn(torch.arange(300))
    perceptron = kind.startswith("mlp")
    hidden = PARAMETERS.hidden if perceptron or kind == "delan" else ()
    friction = () if perceptron else FRICTION
    return DynamicsModels(kind, arm().tree.names, friction, hidden, group.state()), group.nmse()


@pytest.mark.parametrize("kind", KINDS)
def test_models_from_a_file_predict_what_they_predicted_in_training(kind, tmp_path):
    models, errors = trained(kind)
    for name in ("models", "again"):
        write_dynamics_models(models, tmp_path / f"{name}.safetensors")
    assert (tmp_path / "models.safetensors").read_bytes() == (tmp_path / "again.safetensors").read_bytes()
    back = read_dynamics_models(tmp_path / "models.safetensors")
    for name in ("kind", "joints", "friction", "hidden"):
        assert getattr(back, name) == getattr(models, name)
    assert back.count == 2
    motion = rubbing_motion(arm())
    torques = predicted_torques(back, arm().tree, motion)
    for model in range(2):
        np.testing.assert_allclose(nmse(torques[model], motion.torque), errors[model], rtol=1e-4)


def test_files_that_hold_something_else_are_refused(tmp_path):
    path = tmp_path / "models.safetensors"
    write_tensors({"friction": np.zeros((1, 7, 0))}, path, '{"dynamics_models": {"kind": "spd"}}')
    message = r"models\.safetensors: holds no dynamics models \(missing 'joints'\)"
    with pytest.raises(InputError, match=message):
        read_dynamics_models(path)
    write_tensors({"weights": np.zeros(3)}, path, "something else")
    with pytest.raises(InputError, match="holds no dynamics models"):
        read_dynamics_models(path)
    models, _ = trained("spd")
    models.state["inertia"][0, 0, 0] = np.nan
    write_dynamics_models(models, path)
    with pytest.raises(InputError, match="inertia holds a value that is not finite"):
        read_dynamics_models(path)
