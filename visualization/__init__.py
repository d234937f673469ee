"""Pictures and plots; the recording for the rerun viewer is in ``rerun/``.

``summary`` draws ``summary.png`` with the map, the prediction and the tour, ``floor_plan`` plans; both on a ``canvas``
in ``colours`` and with ``dashes`` that the recording shares. ``no_recording`` stands in where nothing is recorded.
"""

from typing import TYPE_CHECKING

from closedrooms.core.runtime.lazy import lazy_face

if TYPE_CHECKING:
    from closedrooms.visualization.floor_plan import draw_plan as draw_plan
    from closedrooms.visualization.summary import draw_cover as draw_cover
    from closedrooms.visualization.summary import draw_map as draw_map
    from closedrooms.visualization.summary import draw_summary as draw_summary

__getattr__, __dir__, __all__ = lazy_face(
    __name__, {"floor_plan": ("draw_plan",), "summary": ("draw_cover", "draw_map", "draw_summary")}
)
