"""The physics in float64: what the device computes in float32 under the same names, and what tests compare with."""
