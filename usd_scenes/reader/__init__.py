"""Reads a USD stage into a `fgf_warp.scene.Scene`; reading is validation."""

from usd_scenes.reader.camera import look_at
from usd_scenes.reader.choices import ReadOptions
from usd_scenes.reader.edits import EditError, Edits
from usd_scenes.reader.frames import Frame, kind_of, name_of
from usd_scenes.reader.open_stages import OpenStages
from usd_scenes.reader.readings import StageReading, StageSurvey
from usd_scenes.reader.settings import Product
from usd_scenes.reader.stage import (
    COMPLEXITIES,
    read_products,
    read_scene,
    read_stage,
    survey_stage,
)

__all__ = [
    "COMPLEXITIES",
    "EditError",
    "Edits",
    "Frame",
    "OpenStages",
    "Product",
    "ReadOptions",
    "StageReading",
    "StageSurvey",
    "kind_of",
    "look_at",
    "name_of",
    "read_products",
    "read_scene",
    "read_stage",
    "survey_stage",
]
