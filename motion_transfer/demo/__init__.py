"""A small demo: a painted person with its exact IUV, and a short driver."""
