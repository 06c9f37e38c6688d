"""The page of `fgf report`, and what a browser makes of it."""

import json
import re

import pytest
from typer.testing import CliRunner

from generators.cli import app
from generators.dataset import layout
from generators.dataset.images import choose_shown
from generators.dataset_report.page import rerender_command, write_dataset_report
from tests.browser import CHROMIUM, Page
from tests.generators.made_up import make_dataset

FAILED, MISSING = 5, 23


@pytest.fixture(scope="module")
def dataset(tmp_path_factory):
    return make_dataset(tmp_path_factory.mktemp("report") / "made-up", missing=[MISSING], failed=[FAILED])


@pytest.fixture(scope="module")
def html(dataset):
    write_dataset_report(dataset)
    return dataset.store.folder / layout.REPORT


@pytest.fixture
def data(html):
    return json.loads(re.search(r'<script type="application/json" id="data">(.*?)</script>', html.read_text(), re.S)[1])


def column(data, name):
    return next(column for column in data["columns"] if column["name"] == name)


def test_it_holds_what_is_known_of_every_sample(data, dataset):
    assert len(data["status"]) == 24
    assert data["status"][FAILED] == "failed"
    assert data["status"][MISSING] == "missing"
    assert data["failures"] == {
        "5": {"reason": "3 samples are not finite, most of them in pixel (1, 2)", "attempts": 2}
    }
    assert column(data, "H")["values"] == dataset.plan["H"].to_pylist()
    assert column(data, "H")["grid"] == [-0.5, -0.25, -0.1]
    assert column(data, "look")["category"]
    assert column(data, "seed")["values"][1] == str(2**62 + 1)
    assert column(data, "luminance_mean")["group"] == "statistic"
    assert column(data, "render_seconds")["values"][MISSING] is None
    assert {"name": "sigma_m", "value": 2.0} in data["constants"]
    assert len(data["thumbnails"]) == 22


def test_words_of_a_dataset_stay_words(tmp_path):
    """Whatever a name says, it ends no script and makes no element."""
    dataset = make_dataset(tmp_path, failed=[3])
    dataset.meta = type(dataset.meta)(**{**vars(dataset.meta), "name": "</script><b id='evil'>&", "description": "<i>"})
    written = write_dataset_report(dataset)
    assert written == f"{tmp_path}/report.html"
    text = (tmp_path / "report.html").read_text()
    assert "<b id=" not in text
    assert "<i>" not in text
    assert text.count("</script>") == 2


def test_many_samples_are_shown_by_some(tmp_path):
    assert choose_shown(range(10), 20) == list(range(10))
    shown = choose_shown(range(10, 10_010), 2000)
    assert [(index - 10) // 5 for index in shown] == list(range(2000))
    # Of an axis whose ten values repeat along the samples, each is shown.
    assert min(sum(index % 10 == value for index in shown) for value in range(10)) > 150


def test_the_command_names_the_sample(dataset):
    location = dataset.store.location
    assert rerender_command(dataset) == (f"fgf generate {location} --sample {{index}} --out made-up-sample-{{index}}")


def test_the_command_line_writes_it_elsewhere_too(dataset, tmp_path):
    outcome = CliRunner().invoke(app, ["report", dataset.store.location, "--out", str(tmp_path / "page.html")])
    assert outcome.exit_code == 0, outcome.output
    assert f"wrote {tmp_path / 'page.html'}" in outcome.stdout
    assert '"base":"../' in (tmp_path / "page.html").read_text()
    refused = CliRunner().invoke(app, ["report", dataset.store.location, "--out", str(tmp_path / "no" / "page.html")])
    assert refused.exit_code == 2
    assert "there is no folder" in refused.stderr


def test_an_object_store_gets_its_page_as_well():
    dataset = make_dataset("memory://reported", missing=range(2, 24))
    assert write_dataset_report(dataset) == "memory://reported/report.html"
    assert dataset.store.exists(layout.REPORT)


needs_browser = pytest.mark.skipif(CHROMIUM is None, reason="there is no Chromium")


@needs_browser
@pytest.mark.parametrize(("width", "dark"), [(1280, False), (400, True)])
def test_a_browser_has_nothing_to_complain_of(html, width, dark):
    with Page(html, width, dark=dark) as page:
        page.run("document.querySelector('#sheet button.cell').click()")
        assert page.run("document.querySelector('dialog').open")
        page.run("document.querySelector('#next').click(); document.querySelector('dialog').close()")
        for box in ("sheet-controls", "scatter-controls"):
            # Every choice of every list is drawn.
            page.run(
                f"""for (let at = 0; at < document.querySelectorAll('#{box} select').length; at++)
                    for (let i = 0; i < document.querySelectorAll('#{box} select')[at].options.length; i++) {{
                        const list = document.querySelectorAll('#{box} select')[at];
                        list.selectedIndex = Math.min(i, list.options.length - 1);
                        list.dispatchEvent(new Event('change'));
                        if (at >= document.querySelectorAll('#{box} select').length) break;
                    }}"""
            )
        assert page.complaints == []
        assert [url for url in page.requests if not url.startswith("data:")] == [html.as_uri()]
        assert page.run("document.documentElement.scrollWidth <= document.documentElement.clientWidth")
        background = page.run("getComputedStyle(document.body).backgroundColor")
        assert (background == "rgb(255, 255, 255)") is not dark


@needs_browser
def test_a_browser_shows_what_is_there(html):
    with Page(html, 1280) as page:
        # H down, and the first of the axes with as many values or fewer across.
        assert page.run("document.querySelectorAll('#sheet button.cell').length") == 6
        assert page.run("document.querySelectorAll('#charts-parameter figure').length") >= 4
        assert page.run("document.querySelectorAll('#scatter circle').length") == 22
        assert page.run("document.querySelectorAll('#slowest tbody tr').length") == 10
        assert "sample 22" in page.run("document.querySelector('#slowest tbody tr').textContent")
        assert "3 samples are not finite" in page.run("document.querySelector('#failure-list').textContent")
        page.run("document.querySelector('#failure-list button').click()")
        assert "--sample 5 " in page.run("document.querySelector('#sample-body code').textContent")
        assert "Failed after 2 attempts" in page.run("document.querySelector('#sample-body').textContent")


@needs_browser
def test_the_keyboard_reaches_the_samples(html):
    with Page(html, 1280) as page:
        page.run("document.querySelector('#sheet button.cell').focus()")
        page.press("Enter")
        assert page.run("document.querySelector('#sample-title').textContent").startswith("Sample 0 (1 of 4)")
        page.press("ArrowRight")
        assert "(2 of 4)" in page.run("document.querySelector('#sample-title').textContent")
        page.press("Escape")
        assert not page.run("document.querySelector('dialog').open")
        page.run("document.querySelector('#scatter').focus()")
        page.press("ArrowRight")
        assert "sample" in page.run("document.querySelector('#scatter-note').textContent")
        page.press("Enter")
        assert page.run("document.querySelector('dialog').open")
