"""The extremes that every law and every phase function is tried at."""

import itertools

KAPPAS = (1e-8, 1e-4, 1e-2, 0.3, 1.0, 10.0, 1e3, 1e8)
BS = (-0.96, -0.5, -0.02, -1e-5, 0.0, 1e-5, 0.02, 0.2, 0.5, 0.9, 0.98, 1.0)
LAWS = tuple(itertools.product(BS, KAPPAS))
ASYMMETRIES = (0.0, 1e-7, -1e-7, 1e-3, 0.5, -0.8, 0.99, -0.99, 0.9999, -0.9999)
TRANSPORTS = ("reciprocal", "renewal", "mixed")

REGIMES = {
    "exponential": dict(),
    "white": dict(hurst=-0.5, white_noise_scale=2.5),
    "pink": dict(hurst=-0.25, white_noise_scale=2.0),
    "pink near fBm": dict(hurst=-0.03, white_noise_scale=0.5),
    "negative": dict(hurst=-0.7, white_noise_scale=2.0),
    "fbm": dict(hurst=0.3, white_noise_scale=1.0, outer_scale=10.0),
    "exact fbm": dict(hurst=0.1, white_noise_scale=0.5, outer_scale=12.0, line_variance="exact"),
    "kfbm": dict(hurst=1.6, white_noise_scale=0.05, outer_scale=4.0),
}
"""Parameters of `Medium`, one set for each regime of the theory and one near its edge."""

PHASES = {
    "isotropic": dict(),
    "hg": dict(asymmetry=0.7),
    "two_lobe": dict(asymmetry=0.9, back_asymmetry=-0.7, back_weight=0.3),
    "draine": dict(asymmetry=-0.4, draine_alpha=20.0),
}
"""Parameters of `Medium`, one set for each phase function."""
