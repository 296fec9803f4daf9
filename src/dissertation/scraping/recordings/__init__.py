"""The recordings of the scraping testbed."""
