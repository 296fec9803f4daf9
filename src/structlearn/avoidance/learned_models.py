"""What has been learned: avoidance models of four kinds by what they learned from, and their files."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from structlearn.avoidance.avoidance_network import (
    AvoidanceNetworks,
    read_avoidance_networks,
    write_avoidance_networks,
)
from structlearn.avoidance.features import CouplingModel
from structlearn.avoidance.human_inspired import (
    HumanInspiredModels,
    read_human_inspired,
    write_human_inspired,
)
from structlearn.avoidance.phase_modulated import (
    PhaseModulatedAvoidance,
    read_phase_modulated,
    write_phase_modulated,
)

NETWORK, ENSEMBLE = "network", "ensemble"
HUMAN_INSPIRED, PHASE_MODULATED = "human_inspired", "phase_modulated"
"""Kinds of models: names of their files, and in tables."""

SETTING, ALL = "setting", "all"
"""What a model learned from, if not from all scenarios of a shape: from one scenario, or from all of them."""


@dataclass(frozen=True)
class AvoidanceModels:
    """Models of one person by what they learned from: a shape, `all`, or `setting`.

    The latter are stacks with a model for each of some scenarios.
    """

    networks: Mapping[str, AvoidanceNetworks]  # the avoidance network, a single one as in the text
    ensembles: Mapping[str, AvoidanceNetworks]  # means of several (`network_training.EnsembleParameters`)
    human_inspired: Mapping[str, HumanInspiredModels]  # the model of Rai et al.
    phase_modulated: Mapping[str, PhaseModulatedAvoidance]  # the phase-modulated network; may be left out

    @property
    def kinds(self) -> dict[str, Mapping[str, CouplingModel]]:
        """The models by their kind."""
        return {
            NETWORK: self.networks,
            ENSEMBLE: self.ensembles,
            HUMAN_INSPIRED: self.human_inspired,
            PHASE_MODULATED: self.phase_modulated,
        }

    @property
    def per_scenario(self) -> dict[str, AvoidanceNetworks | HumanInspiredModels]:
        """The stacks that learned single scenarios, by their kind; not every kind has one."""
        stacked: dict[str, Mapping[str, AvoidanceNetworks | HumanInspiredModels]] = {
            NETWORK: self.networks,
            ENSEMBLE: self.ensembles,
            HUMAN_INSPIRED: self.human_inspired,
        }
        return {kind: found[SETTING] for kind, found in stacked.items() if SETTING in found}


def write_models(models: AvoidanceModels, folder: str | Path) -> None:
    """Write one safetensors file per kind of model into a folder."""
    write_avoidance_networks(models.networks, _file(folder, NETWORK))
    write_avoidance_networks(models.ensembles, _file(folder, ENSEMBLE))
    write_human_inspired(models.human_inspired, _file(folder, HUMAN_INSPIRED))
    if models.phase_modulated:
        write_phase_modulated(models.phase_modulated, _file(folder, PHASE_MODULATED))


def read_models(folder: str | Path) -> AvoidanceModels:
    """Read what `write_models` wrote.

    Raises:
        InputError: a file is missing or holds something else.
    """
    modulated = _file(folder, PHASE_MODULATED)
    return AvoidanceModels(
        networks=read_avoidance_networks(_file(folder, NETWORK)),
        ensembles=read_avoidance_networks(_file(folder, ENSEMBLE)),
        human_inspired=read_human_inspired(_file(folder, HUMAN_INSPIRED)),
        phase_modulated=read_phase_modulated(modulated) if modulated.exists() else {},
    )


def _file(folder: str | Path, kind: str) -> Path:
    return Path(folder) / f"{kind}.safetensors"
