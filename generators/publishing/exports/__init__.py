"""A dataset in the forms in which others keep theirs: tar shards, tables with images inside, and arrays."""
