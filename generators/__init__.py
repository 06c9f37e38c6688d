"""Datasets: a config that sweeps a medium's parameters becomes labelled images, by the command line `fgf`."""
