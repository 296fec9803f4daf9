"""Simulation shared by several testbeds: arms, fingers with electrodes, noise of a hand."""
