"""The posed body: shape, skin in any pose, capsules, a camera, and its exact IUV."""
