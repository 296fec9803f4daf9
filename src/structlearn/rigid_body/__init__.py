"""Rigid-body dynamics of arms from their URDFs: Newton-Euler, its parameters, and models that learn them."""
