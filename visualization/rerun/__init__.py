"""The recording of a run for the rerun viewer; nobody else imports rerun.

``opening`` gives a ``recorder`` or none. The recorder writes into a ``stream`` what ``drawables`` make of our values:
the ``building``, the map as it grows, the ``prediction`` with the tours; ``blueprint`` says how the viewer opens.
"""

import os

# What rerun's writer logs of a full disk are four lines on standard error; we tell it in one of our own.
os.environ.setdefault("RUST_LOG", "off")
