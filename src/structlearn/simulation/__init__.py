"""Simulation shared by several testbeds: an arm, fingers and their electrodes, noise of a hand."""
