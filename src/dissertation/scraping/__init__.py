"""Scraping with tactile feedback (chapter IV) on a tilting board."""
