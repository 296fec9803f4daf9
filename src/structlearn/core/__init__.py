"""Common ground: rotations, frames, signals, parameters, artefacts, processes, errors."""
