"""The map to pan and zoom: Leaflet in a flat coordinate system, its units metres of the grid's frame."""

import contextlib
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from nicegui import ui
from shapely.geometry import MultiLineString, mapping
from shapely.geometry.base import BaseGeometry

from closedrooms.core.door import Point, Segment
from closedrooms.visualization.colours import Colour

# A metre takes 2 ** zoom pixels: from a campus on a telephone to a cell of a centimetre. Leaflet is loaded after these
# options are read, so that the flat coordinate system has to be asked for when the map is made.
OPTIONS = """{get crs() { return window.L.CRS.Simple; }, minZoom: -6, maxZoom: 11, zoomSnap: 0.25,
attributionControl: false, keyboard: false, doubleClickZoom: false}"""
# The scale bar, and markers as handles that tell when they are clicked or dragged: NiceGUI's Leaflet passes neither.
SCRIPT = """
const map = getElement(%d).map;
L.control.scale({imperial: false, maxWidth: 160}).addTo(map);
let focused = null;  // the door that has it, whose handle is drawn anew where it changes
map.on('layeradd', ({layer}) => {
  const handle = layer.options.handle;
  if (!handle || layer.told) return;
  layer.told = true;
  const shape = document.createElement('div');
  shape.className = 'handle handle-' + handle.kind;
  shape.style.setProperty('--colour', handle.colour);
  shape.dataset.label = handle.label;
  layer.setIcon(L.divIcon({html: shape, className: '', iconSize: null}));
  const element = layer.getElement();
  element.setAttribute('aria-label', handle.kind + ' ' + handle.name);
  if (handle.kind === 'door' || handle.kind === 'chosen') {
    element.dataset.handle = handle.name;
    const active = document.activeElement;
    const here = active === document.body || active.dataset.handle === handle.name;
    if (focused === handle.name && here) element.focus({preventScroll: true});
    element.addEventListener('focus', () => { focused = handle.name; });
    element.addEventListener('blur', ({relatedTarget}) => setTimeout(() => {
      if (element.isConnected && relatedTarget?.dataset.handle !== handle.name) focused = null;
    }));
  }
  const tell = type => emitEvent('handle',
    {type, kind: handle.kind, name: handle.name, x: layer.getLatLng().lng, y: layer.getLatLng().lat});
  for (const type of ['click', 'dragend']) layer.on(type, () => tell(type));
  layer.on('keypress', ({originalEvent}) => originalEvent.key === 'Enter' && tell('click'));
});
document.addEventListener('keydown', e => {  // from within a field too
  if (!(e.ctrlKey || e.metaKey) || e.key.toLowerCase() !== 's') return;
  e.preventDefault();
  if (!e.repeat) emitEvent('save');
});
true;
"""
# Of moves by a key: Leaflet gives up one that still glides for the next, so that a key that is held would hardly move.
AT_ONCE = {"animate": False}
# How long a browser with other work to do may take to answer [s].
PATIENCE = 120.0
CSS = """
.leaflet-container { background: #dedede; font: inherit; }
.leaflet-image-layer { image-rendering: pixelated; }
.handle { position: absolute; transform: translate(-50%, -50%); width: 16px; height: 16px; border-radius: 50%;
  background: #fff; border: 3px solid var(--colour); cursor: grab; }
.handle::before { content: ''; position: absolute; inset: -12px; }
.handle::after { content: attr(data-label); position: absolute; left: 14px; bottom: 8px; white-space: nowrap;
  border-radius: 9px; font-size: 12px; line-height: 18px; padding: 0 6px; color: #222; background: #fff;
  border: 2px solid var(--colour); }
.handle[data-label='']::after { display: none; }
.handle-chosen { background: #222; }
.handle-chosen::after { background: #222; color: #fff; }
.handle-jamb { width: 12px; height: 12px; border-radius: 2px; cursor: crosshair; }
.handle-jamb::before { inset: -6px; }
.handle-proposal { width: 8px; height: 8px; border: 0; background: none; cursor: pointer; }
.handle-proposal::after { border-style: dashed; }
.handle-note { width: 0; height: 0; border: 0; background: none; pointer-events: none; }
.handle-note::after { left: 0; bottom: 0; transform: translate(-50%, 50%); border: 0; font-weight: 600;
  white-space: pre; text-align: center; line-height: 15px; background: rgba(255, 255, 255, .8); }
"""


@dataclass(frozen=True, slots=True)
class HandleEvent:
    """Event of a handle.

    Attributes:
        type: ``click`` or ``dragend``.
        kind: As it was drawn.
        name: As it was drawn.
        point: Where it is now, frame of the grid [m].
    """

    type: str
    kind: str
    name: str
    point: Point


class MapBoard:
    """The map element; layers are drawn in named groups, of which each replaces its last one.

    A handle that stays as it is keeps its element, and with it the focus and a key that is just being pressed.

    Args:
        on_click: Told where somebody clicked, frame of the grid [m].
        on_pointer: Told where the pointer is [m].
        on_handle: Told of handles.
    """

    def __init__(
        self,
        on_click: Callable[[Point], Any],
        on_pointer: Callable[[Point], Any],
        on_handle: Callable[[HandleEvent], Any],
    ) -> None:
        ui.add_css(CSS)
        self._map = ui.leaflet(center=(0.0, 0.0), zoom=4).classes("board")
        self._map.props[":options"] = OPTIONS
        self._map.clear_layers()
        self._groups: dict[str, list[Any]] = {}
        # Handles with what they were drawn as: those that stand, and those of groups that are being redrawn.
        self._handles: dict[str, list[tuple[dict[str, Any], Any]]] = {}
        self._last: dict[str, list[tuple[dict[str, Any], Any]]] = {}
        self._map.on("map-click", lambda event: on_click(_point(event.args)))
        self._map.on("map-mousemove", lambda event: on_pointer(_point(event.args)), throttle=0.1)
        self._on_handle = on_handle
        ui.on("handle", lambda event: self._handled(_handle(event.args)))

    async def ready(self) -> None:
        """Wait until the browser has made the map, and add what NiceGUI's element lacks."""
        await self._map.initialized()
        await ui.run_javascript(SCRIPT % self._map.id, timeout=PATIENCE)

    def show(self, bounds: tuple[float, float, float, float]) -> None:
        """Fit the view to ``(x_min, y_min, x_max, y_max)`` [m]."""
        x0, y0, x1, y1 = bounds
        self._map.run_map_method("fitBounds", [[y0, x0], [y1, x1]], AT_ONCE)

    def pan(self, right: float, down: float) -> None:
        """Move the view by pixels."""
        self._map.run_map_method("panBy", [right, down], AT_ONCE)

    def zoom(self, steps: int) -> None:
        """Go nearer, or further away."""
        self._map.run_map_method("zoomIn" if steps > 0 else "zoomOut", abs(steps), AT_ONCE)

    async def find_middle(self) -> Point:
        """Ask for the middle of the view as it is in the browser, frame of the grid [m]."""
        place = await self._map.run_map_method("getCenter", timeout=PATIENCE)
        return (float(place["lng"]), float(place["lat"]))

    @contextlib.contextmanager
    def redrawn(self, *groups: str) -> Iterator[None]:
        """Replace groups by what is drawn into them within the context; handles that are gone are removed last."""
        for group in groups:
            for layer in self._groups.pop(group, []):
                self._map.remove_layer(layer)
            self._last[group] = self._handles.pop(group, [])
        yield
        for group in groups:
            for _, layer in self._last.pop(group):
                self._map.remove_layer(layer)

    def picture(self, group: str, url: str, bounds: tuple[float, float, float, float], opacity: float = 1.0) -> None:
        """Draw a picture over ``(x_min, y_min, x_max, y_max)`` [m]."""
        x0, y0, x1, y1 = bounds
        self._add(group, self._map.image_overlay(url=url, bounds=[[y0, x0], [y1, x1]], options={"opacity": opacity}))

    def shape(self, group: str, geometry: BaseGeometry, **style: Any) -> None:
        """Draw a geometry [m]; ``style`` as Leaflet's paths take it."""
        options = {"style": style, "interactive": False}
        self._add(group, self._map.generic_layer(name="geoJSON", args=[mapping(geometry), options]))

    def lines(self, group: str, segments: Sequence[Segment], **style: Any) -> None:
        """Draw segments of one style [m]."""
        if segments:
            self.shape(group, MultiLineString(segments), **style)

    def handle(
        self,
        group: str,
        point: Point,
        *,
        kind: str,
        name: str,
        label: str,
        colour: Colour,
        draggable: bool = False,
        opacity: float = 1.0,
    ) -> None:
        """Draw a handle at a point [m]: something to click or to drag, or a mere note."""
        place = (point[1], point[0])
        options = {
            "draggable": draggable,
            "opacity": opacity,
            "interactive": kind != "note",
            "keyboard": kind != "note",
            "handle": {"kind": kind, "name": name, "label": label, "colour": css(colour)},
        }
        key = {"latlng": place, **options}
        last = self._last.get(group, [])
        same = next((number for number, (drawn, _) in enumerate(last) if drawn == key), None)
        layer = self._map.marker(latlng=place, options=options) if same is None else last.pop(same)[1]
        self._handles.setdefault(group, []).append((key, layer))

    def fade(self, group: str, opacity: float) -> None:
        """Set how opaque the pictures or handles of a group are, 0..1."""
        for layer in (*self._groups.get(group, []), *(layer for _, layer in self._handles.get(group, []))):
            layer.run_method("setOpacity", opacity)

    def restyle(self, group: str, **style: Any) -> None:
        """Change the style of the shapes of a group."""
        for layer in self._groups.get(group, []):
            layer.run_method("setStyle", style)

    def _add(self, group: str, layer: Any) -> None:
        self._groups.setdefault(group, []).append(layer)

    def _handled(self, event: HandleEvent) -> Any:
        """Tell of a handle; one that was dragged is not where it was drawn."""
        if event.type == "dragend":
            for handles in self._handles.values():
                for key, _ in handles:
                    if (key["handle"]["kind"], key["handle"]["name"]) == (event.kind, event.name):
                        key["latlng"] = None
        return self._on_handle(event)


def css(colour: Colour) -> str:
    """Write a colour as style sheets do."""
    return "#{:02x}{:02x}{:02x}".format(*colour)


def _point(args: Any) -> Point:
    """Read the place of an event of the map [m]: its lng is x, its lat y."""
    place = args["latlng"]
    return (float(place["lng"]), float(place["lat"]))


def _handle(args: Any) -> HandleEvent:
    point = (float(args["x"]), float(args["y"]))
    return HandleEvent(str(args["type"]), str(args["kind"]), str(args["name"]), point)
