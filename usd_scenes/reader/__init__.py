"""Reads a USD stage into a `fgf_warp.scene.Scene`; reading is validation."""

from usd_scenes.reader.stage import StageReading, StageSurvey, read_scene, read_stage, survey_stage

__all__ = ["StageReading", "StageSurvey", "read_scene", "read_stage", "survey_stage"]
