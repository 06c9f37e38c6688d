"""Reads a USD stage into a `fgf_warp.scene.Scene`; reading is validation."""

from usd_scenes.reader.settings import Product
from usd_scenes.reader.stage import (
    COMPLEXITIES,
    Frame,
    StageReading,
    StageSurvey,
    read_products,
    read_scene,
    read_stage,
    stages_kept_open,
    survey_stage,
)

__all__ = [
    "COMPLEXITIES",
    "Frame",
    "Product",
    "StageReading",
    "StageSurvey",
    "read_products",
    "read_scene",
    "read_stage",
    "stages_kept_open",
    "survey_stage",
]
