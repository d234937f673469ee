"""Small parts of the page: questions, messages, buttons."""

from collections.abc import Callable
from typing import Any

from nicegui import ui

from closedrooms.core.names import shown

KEYS = (
    ("Ctrl+Z, Ctrl+Y", "undo, redo"),
    ("Ctrl+S", "save"),
    ("N", "set a door at the wall nearest to the middle of the view"),
    ("P", "accept the best proposal that is left"),
    ("Tab, Enter", "go from door to door on the map, select one"),
    ("arrows", "move the selected door by 5 cm (Shift: 50 cm), or the view"),
    ("[ ]", "turn the selected door by 5 degrees (Shift: 45)"),
    ("Del", "delete the selected door"),
    ("Esc", "select none"),
    ("+ -", "zoom"),
    ("0", "show all"),
)


async def ask(question: str, yes: str, no: str) -> bool:
    """Ask a question and wait for the answer; leaving it counts as no."""
    with ui.dialog() as dialog, ui.card():
        ui.label(question)
        with ui.row().classes("w-full justify-end"):
            ui.button(no, on_click=lambda: dialog.submit(False)).props("flat")
            ui.button(yes, on_click=lambda: dialog.submit(True))
    answer = await dialog
    dialog.delete()
    return bool(answer)


def show_keys() -> None:
    """Show what keys do."""
    with ui.dialog() as dialog, ui.card(), ui.grid(columns="auto 1fr"):
        for keys, what in KEYS:
            ui.label(keys).classes("text-bold")
            ui.label(what)
    dialog.set_value(True)


def icon_button(icon: str, about: str, work: Any = None) -> ui.button:
    """Make a button with a picture; what it does is said to readers of screens too."""
    button = ui.button(icon=icon, on_click=work).props(f'flat dense round aria-label="{about}"')
    button.tooltip(about)
    return button


def plain_button(icon: str, about: str, work: Callable[[], Any]) -> None:
    """Make a small button of a row; what it does is said to readers of screens."""
    ui.button(icon=icon, on_click=work).props(f'flat dense round size=sm aria-label="{about}"')


def switch(about: str, work: Any) -> ui.switch:
    """Make a switch that is off."""
    return ui.switch(about, value=False, on_change=work).props(f'dense aria-label="{about}"')


def tell(text: str, *, bad: bool = False) -> None:
    """Show a message; a bad one stays until it is closed."""
    # Dark enough for white letters; Quasar's own blue is not.
    kind, colour = ("negative", "red-10") if bad else ("info", "grey-9")
    how: dict[str, Any] = {"type": kind, "color": colour, "close_button": True, "timeout": 0 if bad else 6000}
    ui.notify(shown(text, longest=600), multi_line=True, **how)
