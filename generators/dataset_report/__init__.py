"""A dataset on one page: what was swept, what came out, what it cost, and each sample with its parameters."""
