"""A page that the browser still builds: what is found meanwhile waits until it can be shown."""

import time

from wire import until

QUICK_S = 1.5
"""Many times what the reading of a short test takes."""


def test_a_reading_waits_until_the_browser_has_built_the_page(served, open_tab):
    tab = open_tab(served.url, "?test=step_30min.csv.gz&type=general", is_built=False)
    assert "Figure" not in tab.document()
    time.sleep(QUICK_S)
    assert "Figure" not in tab.document()
    tab.tell_built()
    until(lambda: "Figure" in tab.document())
