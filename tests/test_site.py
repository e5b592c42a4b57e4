"""The site as mkdocs.yml has it, of a page of its own: legible in light and dark, and searched from the disk.

How it looks is the theme's; what is tested is that the settings of ours, and docs/tables.css, do not spoil it.
"""

import subprocess
import sys
from importlib.util import find_spec

import pytest
import yaml

from browser import PROGRAM, Browser
from documents import ROOT

pytestmark = [
    pytest.mark.skipif(PROGRAM is None, reason="needs Chromium (Debian's package chromium)"),
    pytest.mark.skipif(find_spec("zensical") is None, reason="needs baryscope[docs]"),
]

PAGE = """# Title

Words, a [link](index.md), and `code`.

| column | other column |
| --- | --- |
| cell | Quetzalcoatl |

```python
print("of a block")
```
"""
READY = "document.querySelector('[data-md-color-scheme]')"
# WCAG 2.2's contrast of the colours of an element's letters and of what is behind it, drawn on a canvas, which knows
# all ways to write a colour and mixes those that are transparent.
CONTRAST = """(() => {
    const pen = document.createElement('canvas').getContext('2d', {willReadFrequently: true});
    const over = (colours) => { pen.fillStyle = 'white'; pen.fillRect(0, 0, 1, 1);
        for (const one of colours) { pen.fillStyle = one; pen.fillRect(0, 0, 1, 1); }
        return [...pen.getImageData(0, 0, 1, 1).data].slice(0, 3); };
    const linear = (v) => v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4;
    const luminance = ([r, g, b]) => 0.2126 * linear(r / 255) + 0.7152 * linear(g / 255) + 0.0722 * linear(b / 255);
    return ['h1', 'article p', 'article p a', 'p code', 'th', 'td', 'pre code', 'pre .s2'].map((selector) => {
        const one = document.querySelector(selector), behind = [];
        for (let at = one; at; at = at.parentElement) behind.unshift(getComputedStyle(at).backgroundColor);
        const [a, b] = [over([...behind, getComputedStyle(one).color]), over(behind)].map(luminance);
        return [selector, (Math.max(a, b) + 0.05) / (Math.min(a, b) + 0.05), b];
    });
})()"""
LEGIBLE = 4.5  # WCAG 2.2, 1.4.3, level AA


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """A browser, and the page of a site with the settings of ours."""
    folder = tmp_path_factory.mktemp("site")
    settings = yaml.safe_load((ROOT / "mkdocs.yml").read_text(encoding="utf-8"))
    settings["plugins"] = [one for one in settings["plugins"] if isinstance(one, str)]  # without the reference
    (folder / "docs").mkdir()
    (folder / "docs/index.md").write_text(PAGE, encoding="utf-8")
    for name in settings["extra_css"] + settings["extra"].get("polyfills", []):
        (folder / "docs" / name).write_bytes((ROOT / "docs" / name).read_bytes())
    settings |= {"nav": ["index.md"], "site_dir": "built"}
    (folder / "mkdocs.yml").write_text(yaml.safe_dump(settings), encoding="utf-8")
    command = [sys.executable, "-m", "zensical", "build", "--strict", "--config-file", "mkdocs.yml"]
    subprocess.run(command, cwd=folder, check=True, capture_output=True)
    browser = Browser(folder / "profile")
    yield browser, folder / "built/index.html"
    browser.close()


@pytest.mark.parametrize("dark", [False, True])
def test_the_site_is_as_dark_as_the_readers_system_and_legible(site, dark):
    browser, page = site
    browser.open(page, dark=dark, ready=READY)
    for selector, contrast, behind in browser.value(CONTRAST):
        assert contrast > LEGIBLE, selector
        assert (behind < 0.2) == dark, selector
    assert browser.complaints == []


def test_a_button_says_light_dark_and_as_the_system_has_it(site):
    browser, page = site
    browser.open(page, dark=True, ready=READY)
    chosen = []
    for _ in range(3):
        browser.value("document.querySelector('form[data-md-component=palette] label:not([hidden])').click()")
        browser.value("new Promise((done) => setTimeout(done, 300))")
        chosen.append(browser.value("document.body.getAttribute('data-md-color-scheme')"))
    assert chosen == ["default", "slate", "slate"]


def test_pages_that_are_opened_from_the_disk_can_be_searched(site):
    """And ask nothing of the network for that."""
    browser, page = site
    browser.open(page, ready=READY)
    browser.value("document.querySelector('.md-search__button').click()")
    browser.call("Input.insertText", text="quetzal")
    everything = "[...document.querySelectorAll('*')]"
    found = f"{everything}.flatMap((one) => [...one.shadowRoot?.querySelectorAll('[role=option]') ?? []])"
    browser.wait(f"{found}.length")
    assert browser.value(f"{found}.map((one) => one.getAttribute('href'))") == [page.as_uri()]
    assert browser.complaints == []
