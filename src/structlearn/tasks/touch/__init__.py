"""Touches of a skin: latent space, place, force, servoing."""
