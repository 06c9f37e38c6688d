"""The README of an export, whose head tells loaders which files are which split."""

from __future__ import annotations

from collections.abc import Sequence

from generators.dataset.plan_table import PlanMeta
from generators.publishing.exports.samples import Split
from generators.publishing.markdown import code, markdown_template, plain
from generators.publishing.words import CITATION, describe

FILES = {"webdataset": "{}-*.tar", "parquet": "{}.parquet", "npz": "{}.npz"}
"""Those of a split, by the form of the export."""
FOR_DATASETS = ("webdataset", "parquet")
"""Forms that ``datasets`` loads."""


def write_export_card(meta: PlanMeta, kind: str, splits: Sequence[Split]) -> str:
    """In Markdown, with YAML front matter.

    Args:
        meta: of the dataset.
        kind: form of the export.
        splits: that are in it.
    """
    return _TEMPLATE.render(
        meta=meta,
        kind=kind,
        lead=plain(describe(meta)),
        digest=code(meta.digest),
        files={split.name: FILES[kind].format(split.name) for split in splits},
        loadable=kind in FOR_DATASETS,
        counts={split.name: split.labels.num_rows for split in splits},
        citation=CITATION,
    )


_TEMPLATE = markdown_template(
    """---
pretty_name: {{ meta.name | quoted }}
{% if meta.license %}
license: {{ meta.license | lower | quoted }}
{% endif %}
{% if loadable %}
configs:
- config_name: default
  data_files:
{% for split, path in files.items() %}
  - split: {{ split }}
    path: {{ path | quoted }}
{% endfor %}
{% endif %}
---

# {{ meta.name | plain }}

{{ lead }} Exported as {{ kind }} from the dataset whose plan has the SHA-256 {{ digest }}; its card explains the
columns and the physics.

| split | samples | files |
|---|--:|---|
{% for split, path in files.items() %}
| {{ split }} | {{ "{:,}".format(counts[split]) }} | `{{ path }}` |
{% endfor %}

{% if kind == "webdataset" %}
```python
import glob
import webdataset as wds

samples = wds.WebDataset(sorted(glob.glob("{{ files.values() | first }}")), shardshuffle=False)
for sample in samples.decode("pil"):
    sample["png"], sample["json"]["seed"], sample["exr"]
```

Of each sample: `png`, a view{% if not meta.png %} (not in this one){% endif %}; `json`, its labels; `exr`, the file of
its radiance. Seeds are text, since they need all 64 bits.
{% elif kind == "parquet" %}
```python
import pandas as pd

table = pd.read_parquet("{{ files.values() | first }}")
```

Beside the labels: `image`, the file of the view as `bytes`{% if not meta.png %} (not in this one){% endif %}, and
`exr`, the file of the radiance. `datasets.load_dataset` gives `image` as a picture. Seeds are text, since they need all
64 bits.
{% else %}
```python
import numpy as np

arrays = np.load("{{ files.values() | first }}")
arrays["radiance"], arrays["seed"]
```

`radiance` is (sample, height, width, 3) float32, linear Rec.709, `alpha` (sample, height, width); planes begin with
`aov_`, and all other arrays are labels. Numbers that are not known are NaN.
{% endif %}

Source of the model: {{ citation }}
"""
)
