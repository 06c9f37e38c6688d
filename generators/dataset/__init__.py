"""A dataset as files: where they lie, what they hold, how they are written and read. Needs neither USD nor Warp."""
