"""The posed body: a shape, its skin in any pose, a camera, triangles drawn, and the exact IUV."""
