"""The settings of the method, to read and to change."""

from dataclasses import replace
from typing import Any

from nicegui import ui

from closedrooms.core.errors import InvalidInputError
from closedrooms.web.editing.document import Document
from closedrooms.web.editing.settings_form import SettingRow, setting_rows, with_setting


async def ask_settings(document: Document) -> Document | None:
    """Show the settings of a document's method; ``None`` where nothing is to change."""
    rows = setting_rows(document.settings)
    fields: dict[str, Any] = {}
    with ui.dialog() as dialog, ui.card().classes("w-full"):
        ui.label(f"Settings of the method {document.method}").classes("text-bold")
        with ui.scroll_area().classes("w-full").style("height: 60vh"):
            for row in rows:
                fields[row.name] = _field(row)
                ui.label(row.about).classes("text-caption q-mb-sm")
        trouble = ui.label("").classes("text-negative").props("role=alert")

        def submit() -> None:
            try:
                dialog.submit(_changed(document, rows, fields))
            except InvalidInputError as error:
                trouble.set_text(str(error))

        def defaults() -> None:
            for row in rows:
                fields[row.name].set_value(row.standard)

        with ui.row().classes("w-full justify-end"):
            ui.button("defaults", on_click=defaults).props("flat")
            ui.button("cancel", on_click=lambda: dialog.submit(None)).props("flat")
            ui.button("predict with these", on_click=submit)
    answer: Document | None = await dialog
    dialog.delete()
    return answer


def _field(row: SettingRow) -> Any:
    """Make the field in which a setting is typed or chosen."""
    if row.kind == "switch":
        return ui.switch(row.name, value=row.shown)
    if row.kind == "choice":
        return ui.select(list(row.choices), label=row.name, value=row.shown, clearable=row.optional).classes("w-full")
    field = ui.number(row.name, value=row.shown, step=1 if row.kind == "whole" else None).classes("w-full")
    return field.props("clearable") if row.optional else field


def _changed(document: Document, rows: list[SettingRow], fields: dict[str, Any]) -> Document:
    """Change the document to what the form says.

    Raises:
        InvalidInputError: A value that the settings refuse.
    """
    settings = document.settings
    for row in rows:
        if fields[row.name].value != row.shown:
            settings = with_setting(settings, row.name, fields[row.name].value)
    return replace(document, settings=settings)
