"""Reads a USD stage into a `fgf_warp.scene.Scene`; reading is validation."""

from usd_scenes.reader.stage import StageReading, read_scene, read_stage

__all__ = ["StageReading", "read_scene", "read_stage"]
