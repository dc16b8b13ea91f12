"""Take the picture of docs/view.md: `ir view demo` in a headless browser.

python tools/view_picture.py [--folder docs/images]
"""

from __future__ import annotations

import signal
import subprocess
import sys

from _chromium import Browser
from _pictures import folder_asked

SIZE = 1200, 1000
PATIENCE = 120.0  # s


PLANNED = "document.getElementById('link').textContent === 'planned'"


def main() -> None:
    """Start the view, wait for its plan, take the picture."""
    path = folder_asked(__doc__) / "view.png"
    command = [sys.executable, "-m", "ir_cli.main", "view", "demo", "--port", "0"]
    view = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    try:
        assert view.stdout is not None
        with Browser() as browser:
            page = browser.open(view.stdout.readline().strip(), *SIZE)
            page.wait(PLANNED, PATIENCE)
            page.frame()
            page.picture(path, whole=False)
    finally:
        view.send_signal(signal.SIGINT)
        view.wait()


if __name__ == "__main__":
    main()
