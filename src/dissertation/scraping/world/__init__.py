"""Simulated robot, board and people of the scraping testbed."""
