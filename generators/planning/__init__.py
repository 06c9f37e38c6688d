"""From a config to a frozen plan: what every sample of a dataset is to be, before any is rendered."""
