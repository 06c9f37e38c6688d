"""`fgf stability`: the law, its samplers, the parameters and small renders over a grid of extremes, against bounds."""
