"""Numbers of single precision, as their author wrote them."""

import numpy as np
import pytest
from pxr import Sdf, Usd

from usd_scenes.reader.attributes import read_number


@pytest.mark.parametrize("legacy", [False, "1.13"])
@pytest.mark.parametrize("written", [0.1, -2.5, 1.7871231, 1e-30, 3.4e38, 0.0])
def test_a_float_is_what_was_written_whatever_numpy_prints(written, legacy):
    """Libraries that one imports change NumPy's print options."""
    stage = Usd.Stage.CreateInMemory()
    attribute = stage.DefinePrim("/a").CreateAttribute("x", Sdf.ValueTypeNames.Float)
    attribute.Set(written)
    with np.printoptions(legacy=legacy):
        assert read_number(attribute, Usd.TimeCode.Default()) == written
