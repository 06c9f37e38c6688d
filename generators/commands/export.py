"""``fgf export``: a dataset in another form."""

from __future__ import annotations

from typing import Annotated

import typer

from generators.commands.common import EXIT_PARTIAL, check_choice, count_of, progress_bar, warn

FORMS = ("webdataset", "parquet", "npz")


def export(
    form: Annotated[str, typer.Argument(metavar="FORM", help=f"{', '.join(FORMS)}.")],
    location: Annotated[str, typer.Argument(metavar="DIR", help="The dataset: a folder, or a URL such as s3://...")],
    out: Annotated[str, typer.Option("--out", metavar="OUT", help="A folder or URL that is new or empty.")],
) -> None:
    """Write a dataset in another form, per split.

    \b
    webdataset  tar shards of at most 256 MiB; each sample is an EXR, a PNG and its labels as JSON
    parquet     a table with labels and images inside
    npz         float32 arrays of radiance and planes, and labels

    Samples that are failed or missing are left out; there being any, the exit code is 3. Files are compared with their
    recorded hashes on the way.

    \b
    Example:
      fgf export webdataset datasets/quickstart --out shards
    """  # noqa: D301
    from generators.dataset.reader import Dataset  # noqa: PLC0415
    from generators.publishing.exports.export import export as export_dataset  # noqa: PLC0415

    check_choice("FORM", form, FORMS)
    dataset = Dataset(location)
    with progress_bar(counted=True) as progress:
        task = progress.add_task("exporting", total=None)
        done = export_dataset(
            dataset, form, out, lambda count, total: progress.update(task, completed=count, total=total)
        )
    typer.echo(f"{count_of(done.samples, 'sample')} in {count_of(len(done.files), 'file')}")
    typer.echo(f"export  {out}")
    if done.left_out:
        listed = " and ".join(f"{count} {status}" for status, count in done.left_out.items())
        warn([f"{listed} samples are not in it"])
        raise typer.Exit(EXIT_PARTIAL)
