"""Write every generated page."""

import sys

from docs.generate import PAGES, REFERENCE

for name, text in PAGES.items():
    (REFERENCE / name).write_text(text(), encoding="utf-8")
    sys.stdout.write(f"{REFERENCE / name}\n")
