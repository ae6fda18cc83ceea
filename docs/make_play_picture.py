"""Take the picture of the page that docs/play.md shows, with Debian's chromium.

python docs/make_play_picture.py [FILE]
"""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

from playwright.sync_api import sync_playwright

TARGET = Path(__file__).parent / 'images' / 'play.png'
SERVER = ('-m', 'llm_astar_planner.cli.main', 'play', '--no-browser', '--port', '0')


def main() -> None:
    """Serve the page, open it, and write what a window of 1400 x 900 pixels shows."""
    target = sys.argv[1] if len(sys.argv) > 1 else str(TARGET)
    server = subprocess.Popen([sys.executable, *SERVER], stdout=subprocess.PIPE, text=True)  # noqa: S603 - our own command
    try:
        found = re.search(r'http://\S+', server.stdout.readline() if server.stdout else '')
        if found is None:
            sys.exit('llm-astar play has not said where its page is')
        take(found.group(), target)
    finally:
        server.terminate()
        server.wait()


def take(url: str, target: str) -> None:
    """Write a picture of the page at `url` once its plans are there."""
    with sync_playwright() as tools:
        browser = tools.chromium.launch(executable_path='/usr/bin/chromium', args=['--no-sandbox'])
        page = browser.new_page(
            viewport={'width': 1400, 'height': 900}, reduced_motion='reduce', color_scheme='light'
        )
        page.goto(url)
        page.wait_for_selector('#main[aria-busy=false]', timeout=60_000)
        page.wait_for_timeout(300)
        page.screenshot(path=target)
        browser.close()


if __name__ == '__main__':
    main()
