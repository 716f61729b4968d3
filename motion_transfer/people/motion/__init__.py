"""Poses as joint angles, named motions, and motion capture."""
