"""A page that the browser still builds: what is found meanwhile waits until it can be shown."""

import time

QUICK_S = 1.5
"""Many times what the reading of a short test takes."""
PATIENCE_S = 300.0


def test_a_reading_waits_until_the_browser_has_built_the_page(served, wire):
    tab = wire.Tab(served.url, "?test=step_30min.csv.gz&type=general", is_built=False)
    try:
        assert "Figure" not in tab.document()
        time.sleep(QUICK_S)
        assert "Figure" not in tab.document()
        tab.tell_built()
        end = time.monotonic() + PATIENCE_S
        while "Figure" not in tab.document():
            assert time.monotonic() < end, served.log.read_text()
            time.sleep(0.2)
    finally:
        tab.close()
