from .coupling import orientation_target as orientation_target, position_target as position_target
from .coupling_dataset import CouplingDataset as CouplingDataset, leave_one_out as leave_one_out
from .coupling_model import (
    Compiled as Compiled,
    CouplingModel as CouplingModel,
    kernel as kernel,
    read_networks as read_networks,
    write_networks as write_networks,
)
from .runtime import Controller as Controller, Status as Status
from .skill import (
    FadingParameters as FadingParameters,
    Limits as Limits,
    ReactiveSkill as ReactiveSkill,
    Workspace as Workspace,
)
from .skill_file import (
    read_provenance as read_provenance,
    read_skill as read_skill,
    write_skill as write_skill,
)
from .trainers import (
    FeedbackNetworkParameters as FeedbackNetworkParameters,
    Trained as Trained,
    TrainingParameters as TrainingParameters,
)
