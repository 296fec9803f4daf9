"""Stacked networks: M models (folds, seeds, settings) that train as one."""
