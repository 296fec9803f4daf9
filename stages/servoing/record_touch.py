"""Record demonstrations of touch (II.4.1.1)."""

from dissertation.simulation.fingers import PinchParameters
from dissertation.simulation.touch import TouchFingerParameters
from dissertation.simulation.touch_demonstrator import (
    ToucherParameters,
    demonstrate,
    person_with_sensor,
    recorded,
    true_contacts,
)
from structlearn.core.artefacts import publish, write_table
from structlearn.core.stage import run, stage_parameters
from structlearn.readers import write_recordings

import pandas as pd


def main() -> None:
    people = stage_parameters("toucher", ToucherParameters)
    fingers = stage_parameters("touch_finger", TouchFingerParameters)
    electrodes = stage_parameters("testbed.touch", PinchParameters)
    person, finger = person_with_sensor(people, fingers.with_electrodes_of(electrodes))
    runs = list(demonstrate(person, finger))
    recordings = [recorded(one, person) for one in runs]
    truth = pd.concat([true_contacts(one, person) for one in runs], ignore_index=True)
    with publish("data/raw/servoing") as folder:
        write_recordings(recordings, folder)
    write_table(truth, "data/servoing/true_contacts.parquet")


if __name__ == "__main__":
    run(main)
