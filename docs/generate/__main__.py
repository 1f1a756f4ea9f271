"""Write every generated page."""

import sys

from docs.generate import DATA, PAGES, REFERENCE

FILES = {**DATA, **{REFERENCE / name: text for name, text in PAGES.items()}}
for file, text in FILES.items():
    file.parent.mkdir(exist_ok=True)
    file.write_text(text(), encoding="utf-8")
    sys.stdout.write(f"{file}\n")
