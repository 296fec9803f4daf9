from .pi2 import (
    PI2Parameters as PI2Parameters,
    SearchDistribution as SearchDistribution,
    cost_to_go as cost_to_go,
    probabilities as probabilities,
    sample as sample,
    update as update,
)
from .refinement import (
    Environment as Environment,
    RefinementParameters as RefinementParameters,
    Rollout as Rollout,
)
