"""Servoing protocol: controllers, trials and scores."""
