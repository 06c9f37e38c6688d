"""Whether a dataset is whole, what is wrong in it and how that is healed, and how far its run has come."""
