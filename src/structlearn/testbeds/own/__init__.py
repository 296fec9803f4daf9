"""A task of your own: from bags to a checked skill."""
