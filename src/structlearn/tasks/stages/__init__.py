"""Stages of a project's pipeline (`pipeline.yaml`), and the defaults of tasks (`params.yaml`)."""

from structlearn.core.processor import pin

pin()  # before a stage's own imports
