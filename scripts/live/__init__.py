"""The page in which the units run in a browser: target, rig, online estimator and controller of each preset, live.

`chains` turns presets into what the page needs, `page` puts it together with its scripts (page/) and those that draw
reports. `python -m baryscope.live docs/live/index.html` writes it.
"""

from baryscope.live.page import live_page, write_live_page

__all__ = ["live_page", "write_live_page"]
