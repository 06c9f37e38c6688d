"""Image files that are written. Beside the reader of textures, the only place that imports OpenImageIO."""
