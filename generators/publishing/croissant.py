"""Metadata of Croissant 1.1, by which catalogues find a dataset and loaders read it.

The record set ``samples`` holds the labels, with a row for every sample of the plan, and ``views`` the images by their
path, which is the ``png`` of a label.
"""

from __future__ import annotations

import json
from collections.abc import Collection, Mapping, Sequence
from datetime import UTC, datetime
from typing import Any

import pyarrow as pa

from generators.dataset import layout
from generators.dataset.plan_table import INDEX, SPLIT, PlanMeta
from generators.dataset.record import file_entry
from generators.publishing.columns import PNG
from generators.publishing.words import CITATION, describe

CONFORMS_TO = "http://mlcommons.org/croissant/1.1"
CROISSANT_TERMS = (
    *("arrayShape", "citeAs", "column", "equivalentProperty", "extract", "field", "fileObject", "fileProperty"),
    *("fileSet", "format", "includes", "isArray", "isLiveDataset", "jsonPath", "key", "md5", "parentField", "path"),
    *("recordSet", "references", "regex", "repeated", "replace", "samplingRate", "separator", "source", "subField"),
    "transform",
)
CONTEXT = {
    "@language": "en",
    "@vocab": "https://schema.org/",
    "sc": "https://schema.org/",
    "cr": "http://mlcommons.org/croissant/",
    "rai": "http://mlcommons.org/croissant/RAI/",
    "dct": "http://purl.org/dc/terms/",
    "conformsTo": "dct:conformsTo",
    "data": {"@id": "cr:data", "@type": "@json"},
    "dataType": {"@id": "cr:dataType", "@type": "@vocab"},
    "examples": {"@id": "cr:examples", "@type": "@json"},
    **{term: f"cr:{term}" for term in CROISSANT_TERMS},
}
"""The format's own, whole: validators warn of any other."""
PARQUET = "application/x-parquet"
FILES = {
    layout.INDEX: (
        "index",
        "Labels of every sample of the plan, those that are failed or missing among them.",
        PARQUET,
    ),
    layout.PLAN: ("plan", "What each sample is to be: its parameters and its seed.", PARQUET),
    layout.CONFIG: ("config", "What the plan was made from.", "application/yaml"),
    layout.SCENE_RECORD: ("scene", "The files of the stages, with sizes and hashes.", "application/json"),
    layout.CARD: ("card", "What a person should know of the dataset.", "text/markdown"),
    layout.CONTACT_SHEET: ("contact-sheet", "All samples, or some of many, in one picture.", "image/png"),
    **{
        layout.split_metadata(split): (f"{split}-labels", f"Labels of the complete samples of {split}.", PARQUET)
        for split in layout.SPLITS
    },
}
"""The files that the metadata has hashes of: name, description and kind."""
SPLIT_URLS = {"train": "cr:TrainingSplit", "validation": "cr:ValidationSplit", "test": "cr:TestSplit"}


def described_files(splits: Collection[str]) -> tuple[str, ...]:
    """Those of `FILES` that a dataset may have whose plan has samples of these splits."""
    absent = {layout.split_metadata(split) for split in layout.SPLITS if split not in splits}
    return tuple(name for name in FILES if name not in absent)


def write_croissant(meta: PlanMeta, index: pa.Table, files: Mapping[str, bytes], published: str | None = None) -> bytes:
    """The metadata as the content of ``croissant.json``.

    Args:
        meta: of the dataset.
        index: its labels, see `generators.publishing.index`.
        files: contents of those of `FILES` that are there, by name.
        published: the day in ISO 8601; None is today.

    Returns:
        JSON, indented, in UTF-8.
    """
    splits = [split for split in layout.SPLITS if split in index[SPLIT].to_pylist()]
    document = {
        "@context": CONTEXT,
        "@type": "sc:Dataset",
        "conformsTo": CONFORMS_TO,
        "name": meta.name,
        "description": describe(meta),
        "citeAs": CITATION,
        **({"license": meta.license} if meta.license else {}),
        "version": meta.version,
        "datePublished": published or datetime.now(UTC).date().isoformat(),
        "distribution": _files(meta, files),
        "recordSet": [_split_names(splits), *([_views()] if meta.png else []), _samples(index, with_views=meta.png)],
    }
    # A name may hold halves of characters, which no file can.
    return (json.dumps(document, indent=1, ensure_ascii=False) + "\n").encode(errors="replace")


def claimed_hashes(content: bytes) -> dict[str, str]:
    """What the content of a ``croissant.json`` says of the files of `FILES`, by name; nothing where it is damaged.

    Returns:
        SHA-256 in hexadecimal, by name.
    """
    try:
        found = json.loads(content)
    except (ValueError, RecursionError):
        return {}
    entries = found.get("distribution") if isinstance(found, dict) else None
    listed = [entry for entry in entries if isinstance(entry, dict)] if isinstance(entries, list) else []
    return {
        entry["contentUrl"]: str(entry["sha256"])
        for entry in listed
        if isinstance(entry.get("contentUrl"), str) and entry["contentUrl"] in FILES and "sha256" in entry
    }


def _files(meta: PlanMeta, files: Mapping[str, bytes]) -> list[dict[str, Any]]:
    """With hashes, by which a reader, and ``fgf verify``, see whether a file is as it was published."""
    tables = [_file_object(name, *words, files[name]) for name, words in FILES.items() if name in files]
    views = [_file_set("png-files", "8-bit views, sRGB.", "image/png", layout.IMAGE)] if meta.png else []
    radiance = "Radiance and further planes, float32, linear Rec.709."
    return [*tables, *views, _file_set("exr-files", radiance, "image/x-exr", layout.RADIANCE)]


def _file_object(file: str, name: str, description: str, encoding: str, content: bytes) -> dict[str, Any]:
    entry = file_entry(content)
    return {
        "@type": "cr:FileObject",
        "@id": name,
        "name": name,
        "description": description,
        "contentUrl": file,
        "contentSize": f"{entry.bytes} B",
        "encodingFormat": encoding,
        "sha256": entry.sha256,
    }


def _file_set(name: str, description: str, encoding: str, file: str) -> dict[str, Any]:
    return {
        "@type": "cr:FileSet",
        "@id": name,
        "name": name,
        "description": description,
        "encodingFormat": encoding,
        "includes": f"{layout.DATA}/*/*/{file}",
    }


def _split_names(splits: Sequence[str]) -> dict[str, Any]:
    fields = [_field("splits", "name", "as in the labels", "sc:Text"), _field("splits", "url", "its meaning", "sc:URL")]
    data = [{"splits/name": split, "splits/url": SPLIT_URLS[split]} for split in splits]
    return {**_record_set("splits", "name", "Parts of the dataset.", fields), "dataType": "cr:Split", "data": data}


def _views() -> dict[str, Any]:
    files = {"fileSet": {"@id": "png-files"}}
    path = {
        **_field("views", "path", "path of the file", "sc:Text"),
        "source": {**files, "extract": {"fileProperty": "fullpath"}},
    }
    image = {
        **_field("views", "image", "the view", "sc:ImageObject"),
        "source": {**files, "extract": {"fileProperty": "content"}},
    }
    return _record_set("views", "path", "8-bit views of the complete samples.", [path, image])


def _samples(index: pa.Table, *, with_views: bool) -> dict[str, Any]:
    fields = {field.name: _label(field) for field in index.schema}
    fields[SPLIT]["references"] = {"field": {"@id": "splits/name"}}
    if with_views:
        fields[PNG]["references"] = {"field": {"@id": "views/path"}}
    return _record_set("samples", INDEX, "Labels of every sample of the plan.", list(fields.values()))


def _record_set(name: str, key: str, description: str, fields: Sequence[dict[str, Any]]) -> dict[str, Any]:
    return {
        "@type": "cr:RecordSet",
        "@id": name,
        "name": name,
        "description": description,
        "key": {"@id": f"{name}/{key}"},
        "field": fields,
    }


def _label(field: pa.Field) -> dict[str, Any]:
    unit = field.metadata.get(b"unit", b"").decode()
    meaning = field.metadata[b"meaning"].decode() + (f" [{unit}]" if unit else "")
    is_list = pa.types.is_list(field.type)
    return {
        **_field("samples", field.name, meaning, _data_type(field.type.value_type if is_list else field.type)),
        **({"isArray": True, "arrayShape": "-1"} if is_list else {}),
        "source": {"fileObject": {"@id": "index"}, "extract": {"column": field.name}},
    }


def _field(record_set: str, name: str, description: str, data_type: str) -> dict[str, Any]:
    return {
        "@type": "cr:Field",
        "@id": f"{record_set}/{name}",
        "name": name,
        "description": description,
        "dataType": data_type,
    }


def _data_type(kind: pa.DataType) -> str:
    if pa.types.is_boolean(kind):
        return "sc:Boolean"
    if pa.types.is_integer(kind):
        return "sc:Integer"
    return "sc:Float" if pa.types.is_floating(kind) else "sc:Text"
