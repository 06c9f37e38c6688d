"""What a medium may choose beside its parameters, by name; of itself, so that a command line starts without NumPy."""

from typing import Literal

Transport = Literal["reciprocal", "renewal", "mixed"]
TRANSPORTS: tuple[Transport, ...] = ("reciprocal", "renewal", "mixed")
LineVariance = Literal["asymptotic", "exact"]
LINE_VARIANCES: tuple[LineVariance, ...] = ("asymptotic", "exact")
