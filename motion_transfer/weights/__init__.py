"""Find, check and load checkpoints."""
