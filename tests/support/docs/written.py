"""The pages of docs/ that are written from the code: `make docs`."""

from pathlib import Path

from tests.support.docs import failsafes_page, report_page, topics_page
from tests.support.faults import page as faults_page

FOLDER = Path(__file__).parents[3] / "docs"
PAGES = {
    "failsafes": failsafes_page.page,
    "report": report_page.page,
    "topics": topics_page.page,
    "faults": faults_page.page,
}

if __name__ == "__main__":
    for name, page in PAGES.items():
        (FOLDER / f"{name}.md").write_text(page(), encoding="utf-8")
