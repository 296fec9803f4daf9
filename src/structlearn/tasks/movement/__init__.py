"""Movement tasks: demonstrations are segmented, learned as primitives, corrected, checked on a robot."""
