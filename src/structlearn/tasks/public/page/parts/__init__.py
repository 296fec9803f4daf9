"""The page of the recorded data by sets: of each its numbers, claims, sentences, tables and figures."""
