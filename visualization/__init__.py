"""Pictures and plots; the recording for the rerun viewer is in rerun/."""

from typing import TYPE_CHECKING

from closedrooms.core.lazy import lazy_face

if TYPE_CHECKING:
    from closedrooms.visualization.floor_plan import draw_plan as draw_plan
    from closedrooms.visualization.summary import draw_cover as draw_cover
    from closedrooms.visualization.summary import draw_map as draw_map
    from closedrooms.visualization.summary import draw_summary as draw_summary

__getattr__, __dir__, __all__ = lazy_face(
    __name__, {"floor_plan": ("draw_plan",), "summary": ("draw_cover", "draw_map", "draw_summary")}
)
