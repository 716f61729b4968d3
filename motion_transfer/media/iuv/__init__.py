"""IUV in every form that circulates: the table in `formats`, streams by `opening`, `writing`."""
