"""The commands of `fgf`, by topic; `generators.cli` puts them together."""
