"""The pages of the scraping testbed."""
