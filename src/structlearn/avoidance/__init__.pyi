from .avoidance_dataset import AvoidanceDataset as AvoidanceDataset, fit_baseline as fit_baseline
from .avoidance_network import AvoidanceNetworks as AvoidanceNetworks
from .avoiding_unroll import (
    AvoidancePaths as AvoidancePaths,
    GoalChange as GoalChange,
    unroll_avoiding as unroll_avoiding,
)
from .rai_2014 import HumanInspiredModels as HumanInspiredModels, fit_human_inspired as fit_human_inspired
from .learned_models import (
    AvoidanceModels as AvoidanceModels,
    read_avoidance_models as read_avoidance_models,
    write_avoidance_models as write_avoidance_models,
)
from .look_ahead import LookAheadParameters as LookAheadParameters, scene_features as scene_features
from .postprocessing import (
    Deadline as Deadline,
    GoalReach as GoalReach,
    PostprocessingParameters as PostprocessingParameters,
)
from .shapes import Obstacle as Obstacle, obstacle as obstacle
