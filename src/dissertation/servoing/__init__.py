"""Latent-space tactile servoing (chapter II)."""
