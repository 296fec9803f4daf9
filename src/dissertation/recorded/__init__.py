"""Public recordings: readers, tasks that only they have, and the page over all sets."""
