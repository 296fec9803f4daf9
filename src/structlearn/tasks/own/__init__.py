"""Your own tasks: from your recordings to a skill, and to sections on your arm, touch and obstacles."""
