"""Image files. The only package that imports OpenImageIO and colour-science."""
