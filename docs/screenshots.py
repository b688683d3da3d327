"""Pictures of a study's report, light and dark, as docs/report_light.jpg and docs/report_dark.jpg.

A page too long for one picture becomes several, numbered.

    python docs/screenshots.py STUDY_FOLDER [-o docs]

A headless Chromium opens the report, as a reader would from the disk.
"""

import argparse
from pathlib import Path

from browser import Browser

WIDTH, QUALITY = 1120, 68
TALLEST = 4000  # pixels of a picture; of a longer one Chromium repeats the beginning
PLAYER = "document.querySelector('section:has(.player)')"
READY = f"document.readyState === 'complete' && !({PLAYER} && !{PLAYER}.dataset.player)"
# a frame in the middle, between two that the surrogate was trained on
MIDDLE = """(() => {
  const scrub = document.querySelector(".scrub");
  if (!scrub) return;
  const facts = JSON.parse(document.getElementById("player-facts").textContent);
  const half = facts.frames >> 1;
  scrub.value = facts.predictions[0].kept.findIndex((kept, k) => k >= half && !kept);
  scrub.dispatchEvent(new Event("input"));
})()"""


def main() -> None:
    """Take the pictures; end with what the page's console said of errors, if anything."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, help="of a study, with report.html")
    parser.add_argument("-o", "--output", type=Path, default=Path(__file__).parent, help="folder of the pictures")
    parser.add_argument("--whole", action="store_true", help="every section, not only those down to the particles")
    parser.add_argument("--width", type=int, default=WIDTH, help="of the window, in pixels")
    asked = parser.parse_args()
    with Browser() as page:
        for scheme in ("light", "dark"):
            page.look(asked.width, 1000, dark=scheme == "dark")
            page.open(asked.folder / "report.html", READY)
            page.run(MIDDLE)
            last = "document.body" if asked.whole else f"({PLAYER} || document.body)"
            height = page.run(f"{last}.getBoundingClientRect().bottom + scrollY + 16")
            for number, top in enumerate(range(0, int(height), TALLEST)):
                part = (0, top, asked.width, min(height - top, TALLEST))
                target = asked.output / f"report_{scheme}{f'_{number + 1}' if height > TALLEST else ''}.jpg"
                target.write_bytes(page.picture(part, QUALITY))
                print(f"{target}: {target.stat().st_size / 1e3:.0f} kB")
    if page.errors:
        raise SystemExit("\n".join(page.errors))


if __name__ == "__main__":
    main()
