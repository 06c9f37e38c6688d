"""The dataset card: a README that a person reads, with a head that loaders read."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping
from typing import Any

import pyarrow as pa

from fgf_warp.output.exr import channel_names
from fgf_warp.settings import Aov
from generators.dataset import layout
from generators.dataset.plan_table import INDEX, SEED, SPLIT, AxisMeta, PlanMeta
from generators.publishing.columns import COMPLETE, FAILED, MISSING, OURS, STATUS
from generators.publishing.markdown import code, markdown_template, plain
from generators.publishing.words import CITATION, DOI, describe, describe_quality

VALUES_SHOWN = 9
"""Longer lists of an axis's values are cut in the middle."""
SIZES = ((1_000, "n<1K"), (10_000, "1K<n<10K"), (100_000, "10K<n<100K"), (1_000_000, "100K<n<1M"))
"""Names of sizes that the Hugging Face Hub knows."""


def write_card(meta: PlanMeta, index: pa.Table) -> str:
    """The card in Markdown, with YAML front matter.

    Args:
        meta: of the dataset.
        index: its labels, see `generators.publishing.index`.
    """
    status, split_of = index[STATUS].to_pylist(), index[SPLIT].to_pylist()
    counts = Counter(zip(split_of, status, strict=True))
    targets = {axis.name: axis.target for axis in meta.axes}
    columns = {field.name: _Words(field, targets) for field in index.schema}
    return _TEMPLATE.render(
        meta=meta,
        lead=plain(describe(meta)),
        version=plain(meta.version),
        facts=_facts(meta, index.num_rows, status.count(COMPLETE)),
        size=next((name for limit, name in SIZES if index.num_rows < limit), "n>1M"),
        statuses=(COMPLETE, FAILED, MISSING),
        counts=counts,
        splits=[split for split in layout.SPLITS if split in split_of],
        patterns={split: _patterns(meta, split) for split in layout.SPLITS if counts[split, COMPLETE]},
        axes=[(columns[axis.name], _range_of(axis, index)) for axis in meta.axes],
        constants=[f"{code(name)} = {plain(value)}" for name, value in _constants(meta, index)],
        columns=columns.values(),
        citation=CITATION,
        doi=DOI,
    )


def _facts(meta: PlanMeta, planned: int, complete: int) -> Iterator[tuple[str, str]]:
    """What a reader looks for first."""
    missing = f" of {planned:,} planned" if complete < planned else ""
    yield "samples", f"{complete:,}{missing}"
    views = ", and an 8-bit view of each" if meta.png else ""
    yield "images", f"{meta.width} x {meta.height} pixels of float32 radiance, linear Rec.709{views}"
    if meta.aovs:
        yield "further planes", ", ".join(meta.aovs)
    yield "channels", f"`{'`, `'.join(channel_names(frozenset(Aov(name) for name in meta.aovs)))}`"
    yield "noise", f"bounded by {describe_quality(meta)}; what each sample reached is in the labels"
    yield "scene", f"{plain(meta.scene)}, medium {code(meta.medium)}" if meta.medium else plain(meta.scene)
    device = "the CPU" if meta.device == "cpu" else plain(meta.device.upper())
    yield "made with", f"FGF-Warp {plain(meta.version)} on {device}, dataset seed {meta.seed}"
    yield "licence", plain(meta.license) or "not stated"


class _Words:
    """Name, meaning and unit of a column, in Markdown.

    Args:
        field: of the column.
        targets: what each axis changes, by its name.
    """

    def __init__(self, field: pa.Field, targets: Mapping[str, str]) -> None:
        self.name_code = code(field.name)
        self.type = str(field.type).replace("element: ", "")
        self.meaning = field.metadata[b"meaning"].decode()
        if field.name not in OURS:
            target = targets.get(field.name)
            self.meaning = plain(self.meaning) if target is None else f"value of {code(target)}"
        self.unit_code = code(field.metadata[b"unit"].decode())


def _patterns(meta: PlanMeta, split: str) -> list[str]:
    """Of the files that ``datasets`` reads: with views they are a folder of images, else a table."""
    views = [f"{layout.DATA}/{split}/*/{layout.IMAGE}"] if meta.png else []
    return [layout.split_metadata(split), *views]


def _range_of(axis: AxisMeta, index: pa.Table) -> str:
    if axis.values is not None:
        shown = [plain(_shown(value)) for value in axis.values]
        if len(shown) <= VALUES_SHOWN:
            return ", ".join(shown)
        return f"{', '.join(shown[:3])}, ... {', '.join(shown[-2:])} ({len(shown)} values)"
    values = [value for value in index[axis.name].to_pylist() if value is not None]
    if not values or axis.category:
        return ", ".join(plain(_shown(value)) for value in sorted(set(values)))
    return f"{_shown(min(values))} to {_shown(max(values))}, drawn or computed for each sample"


def _constants(meta: PlanMeta, index: pa.Table) -> list[tuple[str, str]]:
    """Labels of the plan that are the same in all samples, and no axes."""
    axes = {axis.name for axis in meta.axes}
    planned = index.column_names[: index.column_names.index(STATUS)]
    found = []
    for name in planned:
        values = index[name].unique().to_pylist()
        if name not in {INDEX, SPLIT, SEED, *axes} and len(values) == 1 and values[0] is not None:
            found.append((name, _shown(values[0])))
    return found


def _shown(value: Any) -> str:
    return f"{value:.6g}" if isinstance(value, int | float) else str(value)


_TEMPLATE = markdown_template(
    """---
pretty_name: {{ meta.name | quoted }}
{% if meta.license %}
license: {{ meta.license | lower | quoted }}
{% endif %}
size_categories:
- {{ size }}
tags:
- rendering
- participating media
- fractional Gaussian fields
- inverse rendering
{% if patterns %}
configs:
- config_name: default
  data_files:
{% for split, paths in patterns.items() %}
  - split: {{ split }}
    path:
{% for path in paths %}
    - {{ path | quoted }}
{% endfor %}
{% endfor %}
{% endif %}
---

# {{ meta.name | plain }}

{{ lead }}

![Contact sheet: every sample, or a part that is spread over all, with its parameters](contact_sheet.png)

| | |
|---|---|
{% for name, value in facts %}
| {{ name }} | {{ value }} |
{% endfor %}

## What varies

{% if axes %}
| axis | meaning | unit | values |
|---|---|---|---|
{% for column, values in axes %}
| {{ column.name_code }} | {{ column.meaning }} | {{ column.unit_code }} | {{ values }} |
{% endfor %}
{% else %}
Nothing but the seed of the noise.
{% endif %}
{% if constants %}

The same in all samples: {{ constants | join(", ") }}.
{% endif %}

{% if splits | length > 1 %}
| split |{% for status in statuses %} {{ status }} |{% endfor %}

|---|{% for status in statuses %}--:|{% endfor %}

{% for split in splits %}
| {{ split }} |{% for status in statuses %} {{ "{:,}".format(counts[split, status]) }} |{% endfor %}

{% endfor %}

{% endif %}
{% if meta.medium %}
## The physics

The medium's extinction is a random field, correlated over distance. Its mean is `sigma_m`; its fluctuations are a
fractional Gaussian field of Hurst exponent `H` and white-noise scale `S_w`. Light that crosses such a medium does not
fall off exponentially: of a segment of length `t`, with the mean optical depth `u`, the mean transmittance is

```
Tr(u) = exp(-u log(1 + y) / y)

u = sigma_m t       y = kappa u^b       b = min(1 + 2 H, 1)
```

- **`H`** says how far the fluctuations reach. At -1/2 they are white noise and the falloff is exponential; towards 0
  (pink noise) and above (fractional Brownian motion, which needs an outer scale `L`) clumps grow and the medium clears;
  below -1/2 neighbours are anti-correlated.
- **`S_w`** says how strong they are. It enters the law as `kappa`, the variance along a line in units of the mean; with
  `kappa` = 0 the medium is the classical one.
- **`b`** and **`kappa`** are all that the law needs of the field; they follow from `H`, `S_w`, `sigma_m` and `L`.
- **`g`** is the mean cosine of scattering, from -1 (back to where the light came from) to 1 (straight on); the albedo
  is the share of light that a collision scatters.

Lengths are in the stage's unit. The model is that of {{ citation }}

{% endif %}
## Load it

Labels as a table, with a row for every sample of the plan:

```python
import pandas as pd

labels = pd.read_parquet("index.parquet")
labels = labels[labels.status == "complete"]
```

{% if patterns and meta.png %}
Views with all labels, by split:

```python
from datasets import load_dataset

samples = load_dataset("PATH/TO/THIS/FOLDER", split="{{ patterns | first }}")
samples[0]["image"], samples[0]["seed"]
```

{% elif patterns %}
Labels by split:

```python
from datasets import load_dataset

labels = load_dataset("PATH/TO/THIS/FOLDER", split="{{ patterns | first }}")
```

{% endif %}
Radiance, float32 (height, width, channel), from the path in a label's `exr`:

```python
import OpenImageIO as oiio

image = oiio.ImageInput.open(labels.exr.iloc[0])
pixels = image.read_image("float")
names = image.spec().channelnames  # in any order
```

Shards for training over a network, after `fgf export webdataset . --out ../shards`:

```python
import glob
import webdataset as wds

shards = sorted(glob.glob("../shards/{{ patterns | first or "train" }}-*.tar"))
samples = wds.WebDataset(shards, shardshuffle=False).decode("pil").to_tuple("png", "json")
```

`croissant.json` describes the same records for loaders of [Croissant](https://docs.mlcommons.org/croissant/).

## Columns

Of `index.parquet`; where a value is not known, as of a sample that is missing, it is null.

| column | type | unit | meaning |
|---|---|---|---|
{% for column in columns %}
| {{ column.name_code }} | {{ column.type }} | {{ column.unit_code }} | {{ column.meaning }} |
{% endfor %}

## Files

```
index.parquet                      labels, one row per sample of the plan
data/SPLIT/metadata.parquet        labels of a split's complete samples
data/SPLIT/000000/radiance.exr     radiance and further planes; every parameter in the header
{% if meta.png %}
data/SPLIT/000000/image.png        a view of it
{% endif %}
data/SPLIT/000000/record.json      what the render reached, with size and SHA-256 of the images
data/SPLIT/000000/timing.json      how long it took
plan.parquet                       what each sample is to be
config.yaml                        what the plan was made from
{% if meta.stages %}
scene/                             the stages that it names, with all that they are made of
{% endif %}
```

## Check it, render it again

Every sample follows from the plan, its seed and the version of FGF-Warp. With FGF-Warp {{ version }} installed,

```sh
fgf verify . --deep                          # is every file what it should be?
fgf generate config.yaml --out ../again      # the same dataset anew
```

The plan's SHA-256 is {{ meta.digest | code }}.
{% if meta.license %}

## Licence

{{ meta.license | plain }}
{% endif %}

## Cite

{{ citation }} [doi:{{ doi }}](https://doi.org/{{ doi }})
"""
)
