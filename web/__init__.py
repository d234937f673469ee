"""The page of ``closedrooms edit``: doors marked on a map in a browser, rooms predicted at once.

What a person does (:mod:`~closedrooms.web.document`), where a door goes (:mod:`~closedrooms.web.snapping`), what is
kept (:mod:`~closedrooms.web.drafts`) and who may look (:mod:`~closedrooms.web.gate`) know nothing of a browser. NiceGUI
is imported by what draws: ``page``, ``map_board``, ``map_layers``, ``door_list``, ``settings_dialog``, ``prompts``.
"""
