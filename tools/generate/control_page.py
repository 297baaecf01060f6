"""Write the figures of `docs/control.md` and `docs/contact.md`, from the files that `bubbleskin bench control --write` has left.

python tools/generate/control_page.py            # write them
python tools/generate/control_page.py --check    # fail if they are not what would be written
"""

import generated

from bubbleskin.bench.control.page import PAGE, TOPS_PAGE, page, tops_page

if __name__ == "__main__":
    generated.main({PAGE: lambda: page(generated.ROOT), TOPS_PAGE: lambda: tops_page(generated.ROOT)})
