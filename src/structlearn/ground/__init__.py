"""What everything stands on: rotations, frames, signals, parameters, artefacts, processes, errors."""
