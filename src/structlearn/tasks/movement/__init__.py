"""Tasks of movements: demonstrations are cut, learned as primitives, corrected, checked on a robot."""
