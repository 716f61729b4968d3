"""Drawing, light, surroundings, and the faults of real IUV."""
