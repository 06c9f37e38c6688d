"""Renders the samples of a plan: in one process or many, on one machine or a cluster, with interruptions.

From the outside in: `run` opens a dataset, has what it lacks rendered, and publishes it; `dispatch` hands chunks of
samples to an executor and tries those of a lost worker again; an executor (`in_process`, `local_pool`, `on_ray`,
`on_slurm`) has chunks rendered somewhere; `render` renders one, wherever it is.
"""
