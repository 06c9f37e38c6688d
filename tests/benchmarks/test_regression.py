"""A dataset is good for what it is for: its images tell the parameters of their medium.

A regressor learns H, g and log10 S_w from the statistics of the training images and predicts them for the test images.
Alpha, which no photograph has, is not among them. Expected are coefficients of determination far above the best of 20
that the same regressor reaches with the parameters of the training images shuffled, which is chance. docs/learning.md
has the figures.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from typer.testing import CliRunner

from generators.cli import app
from generators.dataset import layout
from generators.publishing.statistics import STATISTICS

CONFIG = Path(__file__).parent / "regression.yaml"
TARGETS = {"H": 0.8, "g": 0.85, "S_w": 0.9}
"""What is learned, and the least that is asked for: of the variance of the test images, the share that is explained."""
SHUFFLES = 20

pytestmark = pytest.mark.slow


@dataclass(frozen=True)
class Score:
    """How well a parameter is predicted: explained share of the variance, mean absolute error, and the best chance."""

    explained: float
    error: float
    chance: float


@pytest.fixture(scope="module")
def scores(tmp_path_factory):
    folder = tmp_path_factory.mktemp("regression") / "set"
    done = CliRunner().invoke(app, ["generate", str(CONFIG), "--out", str(folder)])
    assert done.exit_code == 0, done.output
    train, test = (pd.read_parquet(folder / layout.split_metadata(split)) for split in ("train", "test"))
    assert len(train) + len(test) == 512
    return {name: score(features(train), known(train, name), features(test), known(test, name)) for name in TARGETS}


def features(labels):
    """The statistics of radiance; those that are squares by their logarithm."""
    names = [name for name in STATISTICS if name in labels and not name.startswith("alpha")]
    squares = [name for name in names if name.startswith(("structure", "gradient"))]
    return labels[names].assign(**{name: np.log(labels[name]) for name in squares}).to_numpy()


def known(labels, name):
    return np.log10(labels[name].to_numpy()) if name == "S_w" else labels[name].to_numpy()


def score(train, known_train, test, known_test):
    from sklearn.metrics import mean_absolute_error, r2_score
    from sklearn.pipeline import make_pipeline
    from sklearn.preprocessing import StandardScaler
    from sklearn.svm import SVR

    def predict(values):
        return make_pipeline(StandardScaler(), SVR(C=10, epsilon=0.02)).fit(train, values).predict(test)

    rng = np.random.default_rng(0)
    shuffled = [r2_score(known_test, predict(rng.permutation(known_train))) for _ in range(SHUFFLES)]
    predicted = predict(known_train)
    return Score(r2_score(known_test, predicted), mean_absolute_error(known_test, predicted), max(shuffled))


@pytest.mark.parametrize("name", TARGETS)
def test_images_tell_the_parameters_of_their_medium(scores, name):
    found = scores[name]
    print(f"{name}: explained {found.explained:.3f}, mean error {found.error:.3f}, chance {found.chance:.3f}")
    assert found.explained > TARGETS[name]
    assert found.explained > found.chance + 0.5
