"""USD stages as scenes of FGF-Warp: the media's schema, authoring, reading, and the stages that come with it.

The only package that imports ``pxr``. Importing it registers the schema FgfMediumAPI, since USD reads its schemas
once, when the process opens its first stage, and the validators of `usd_scenes.validation`, which USD loads on demand.
"""

from pathlib import Path

from pxr import Plug

from usd_scenes import schema

schema.add_plugin()
Plug.Registry().RegisterPlugins(str(Path(__file__).parent / "validation"))
