"""Picture of the README: the first screen of the report on feedback, as Chromium shows it.

python docs/pictures/page.py
"""

import shutil
import subprocess
import tempfile
from pathlib import Path

from PIL import Image

from structlearn.core.artefacts import publish
from structlearn.core.errors import InputError
from structlearn.core.stage import run

PAGE, SIZE = Path("reports/scraping/feedback.html"), (1000, 790)  # px


def main() -> None:
    """Take it. Raises InputError: there is no Chromium."""
    chromium = shutil.which("chromium") or shutil.which("google-chrome")
    if chromium is None:
        raise InputError("chromium: not found; install it, for example by `apt install chromium`")
    with tempfile.TemporaryDirectory() as folder:
        shot = Path(folder) / "page.png"
        words = ["--headless", "--no-sandbox", "--disable-gpu", "--hide-scrollbars", f"--screenshot={shot}"]
        size = "--window-size={},{}".format(*SIZE)
        subprocess.run([chromium, *words, size, PAGE.resolve().as_uri()], check=True, capture_output=True)
        with publish(Path(__file__).with_suffix(".webp")) as path:
            Image.open(shot).convert("RGB").save(path, format="webp", quality=80, method=6)


if __name__ == "__main__":
    run(main, stage=False)
