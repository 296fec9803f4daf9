"""Tracking with learned models."""
