"""What a run writes: the table in `formats`, made of `segments`, with sound from `audio`."""
