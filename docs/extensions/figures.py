"""Makes the pictures of the pages again: `make figures`. Those of the gallery: `make gallery`.

The pictures of "From nothing to newtons" are written by the commands of that page.
"""

import shutil
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

IMAGES = Path(__file__).parents[1] / "images"
TESTS = Path(__file__).parents[2] / "tests"
CONTACTS, SIZE_PX, WAIT_MS = 4, (1440, 810), 120_000


def viewer_picture(path: Path) -> None:
    """The viewer on the built-in scene, when four fingers press."""
    from playwright.sync_api import sync_playwright

    sys.path.insert(0, str(TESTS))
    from browser import CHROMIUM, FLAGS

    program = [sys.executable, "-m", "manytouch", "run", "sim:fingers", "--fps", "10"]
    session = subprocess.Popen(program, stdout=subprocess.PIPE, text=True)
    assert session.stdout is not None
    try:
        address = next(line.split()[-1] for line in session.stdout if "viewer at" in line)
        with sync_playwright() as playwright:
            browser = playwright.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
            page = browser.new_page(viewport={"width": SIZE_PX[0], "height": SIZE_PX[1]})
            page.add_init_script("localStorage.setItem('tour-done', 'yes')")
            page.goto(address)
            for _ in range(WAIT_MS // 200):
                page.wait_for_timeout(200)
                if page.inner_text("#contact-count") == str(CONTACTS):
                    break
            else:
                raise SystemExit(f"there were never {CONTACTS} contacts")
            page.wait_for_timeout(600)
            page.screenshot(path=path)
            browser.close()
    finally:
        session.terminate()
        session.communicate(timeout=60)


def paper_pictures(folder: Path) -> None:
    """Every step of the paper's method on the built-in scene `one`."""
    with TemporaryDirectory() as explained:
        program = [sys.executable, "-m", "manytouch", "explain", "sim:one", "--out", explained]
        subprocess.run(program, check=True)
        for picture in folder.glob("*.png"):
            shutil.copy(Path(explained) / picture.name, picture)


if __name__ == "__main__":
    viewer_picture(IMAGES / "viewer.png")
    paper_pictures(IMAGES / "paper")
