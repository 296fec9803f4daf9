"""What people would use today on the same demonstrations: policies without structure, beside the feedback."""
