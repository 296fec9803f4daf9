"""Record demonstrations of touch: simulated, or taken over from your own bags (II.4.1.1)."""

import pandas as pd

from structlearn.ground.artefacts import publish, write_table
from structlearn.ground.stage import run, stage_parameters
from structlearn.recordings import read_recordings, write_recordings
from structlearn.recordings.source import SourceParameters
from structlearn.simulation.fingers import TouchParameters
from structlearn.simulation.touch import TouchFingerParameters
from structlearn.simulation.touch_demonstrator import (
    ToucherParameters,
    demonstrate,
    no_contacts,
    recorded,
    true_contacts,
)


def main() -> None:
    parameters = stage_parameters("record_touch", SourceParameters)
    truth = no_contacts()
    if parameters.simulated:
        person = stage_parameters("toucher", ToucherParameters)
        finger = stage_parameters("touch_finger", TouchFingerParameters)
        electrodes = stage_parameters("testbed.touch", TouchParameters)
        runs = list(demonstrate(person, finger.with_electrodes_of(electrodes)))
        recordings = [recorded(one, person) for one in runs]
        truth = pd.concat([true_contacts(one, person) for one in runs], ignore_index=True)
    else:
        recordings = read_recordings(parameters.source, parameters.topics)
    with publish("data/raw/servoing") as folder:
        write_recordings(recordings, folder)
    write_table(truth, "data/servoing/true_contacts.parquet")


if __name__ == "__main__":
    run(main)
