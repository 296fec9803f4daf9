"""Stages of a project's pipeline (`pipeline.yaml`), and the defaults of tasks (`params.yaml`)."""
