"""What all packages share: rotations, frames, signals, parameters, artefacts, processes, errors."""
