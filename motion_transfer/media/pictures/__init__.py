"""Pictures of people: single photos in `photo`, clips of every format by the table in `formats`."""
