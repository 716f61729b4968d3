"""Evaluation on equal terms: the same pairs, the same framing, the same numbers for all methods."""
