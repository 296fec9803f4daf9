"""The simulated robot, board and people of the scraping testbed."""
