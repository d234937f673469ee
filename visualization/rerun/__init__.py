"""The recording of a run for the rerun viewer; nobody else imports rerun.

``optional_recording`` gives a ``recorder``, or one that does nothing. The recorder writes into a ``stream`` what
``drawables`` make of our values: the ``recorded_building``, the ``recorded_robot`` and the map as it grows, the
``recorded_prediction`` (``drawn_prediction``, the candidates ``weighed`` for whole rooms, the ``drawn_sureness`` of
cells and rooms), the ``drawn_tours``, the ``curves`` of the run and texts (``documents``). ``blueprint`` says how the
viewer opens: in ``tabs`` of ``views``. ``live`` starts one that shows the recording while it is written.
"""

import os

# What rerun's writer logs of a full disk are four lines on standard error; we tell it in one of our own.
os.environ.setdefault("RUST_LOG", "off")
