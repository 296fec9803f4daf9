"""Movement tasks: demonstrations are cut, learned as primitives, corrected, and checked on a robot."""
