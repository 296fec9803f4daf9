"""Shared basics: rotations, frames, signals, parameters, artefacts, processes, errors."""
