"""Draw pages at a desk, on a phone and on paper, to look at them.

    python tools/page_pictures.py out/report.html http://127.0.0.1:8880/#TOKEN [--folder out/pages]

NAME_desk.png (1,400 px), NAME_phone.png (390 px) and NAME.pdf (A4); with pypdfium2 installed also a
PNG of each sheet. Chromium draws them without a screen; a fault of a page ends the script.
"""

from __future__ import annotations

import argparse
import base64
import importlib
import sys
from pathlib import Path

from _chromium import Browser, Page

SIZES = {"desk": (1400, 900), "phone": (390, 844)}
LIVE = "document.getElementById('link').textContent !== 'connecting'"
UNFOLD = "document.querySelectorAll('details').forEach((each) => { each.open = true; })"
DOTS_PER_POINT = 1.4  # of the sheets: 100 dots an inch


def main() -> int:
    """Writes all pictures; returns 1 where a page has a fault."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("pages", nargs="+", help="HTML files, or addresses of a view")
    parser.add_argument("--folder", type=Path, default=Path("out/pages"), help="out/pages")
    parser.add_argument("--name", default="", help="of the pictures of a single page")
    parser.add_argument("--unfold", action="store_true", help="also with all parts unfolded")
    asked = parser.parse_args()
    asked.folder.mkdir(parents=True, exist_ok=True)
    faults = []
    with Browser() as browser:
        for page in asked.pages:
            name = asked.name or Path(page).stem
            faults += draw(browser, page, asked.folder / name, unfold=asked.unfold)
    sys.stderr.write("".join(f"{fault}\n" for fault in faults))
    return 1 if faults else 0


def draw(browser: Browser, address: str, base: Path, *, unfold: bool) -> list[str]:
    """Writes the pictures of one page; returns what was wrong with it."""
    faults = []
    served = address.startswith("http")
    if not served and not Path(address).is_file():
        return [f"{address}: no such file"]
    for name, (wide, high) in SIZES.items():
        where = address if served else Path(address)
        page = browser.open(where, wide, high, touch=name == "phone")
        if served:
            page.wait(LIVE)
        page.picture(_file(base, f"_{name}.png"))
        if unfold:
            page.run(UNFOLD)
            page.picture(_file(base, f"_{name}_unfolded.png"))
        if name == "desk":
            print_sheets(page, base)
        faults += page.faults
        page.close()
    return faults


def _file(base: Path, ending: str) -> Path:
    return base.with_name(base.name + ending)


def print_sheets(page: Page, base: Path) -> None:
    """Writes the page as PDF, and where pypdfium2 is installed a PNG of each sheet."""
    printed = page.call("Page.printToPDF", preferCSSPageSize=True, printBackground=True)
    document = base.with_name(base.name + ".pdf")
    document.write_bytes(base64.b64decode(printed["data"]))
    try:
        reader = importlib.import_module("pypdfium2")
    except ImportError:
        return
    for number, sheet in enumerate(reader.PdfDocument(document), start=1):
        picture = sheet.render(scale=DOTS_PER_POINT).to_pil()
        picture.save(_file(base, f"_paper_{number}.png"))


if __name__ == "__main__":
    sys.exit(main())
