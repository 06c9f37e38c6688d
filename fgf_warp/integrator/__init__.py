"""The kernels that render: the stages of a path's life, and the drivers that take paths through them."""
