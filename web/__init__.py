"""The page of ``closedrooms edit``: doors marked on a map in a browser, rooms predicted at once.

- Without a browser: ``sheet`` is the map, ``session`` a visitor at work on it, ``document`` what they do, ``snapping``
  where a door goes, ``drafts`` what is kept, ``gate`` who may look, ``settings_form`` the settings as rows,
  ``pictures`` encode a map.
- Drawn with NiceGUI: ``server`` opens the ``page``, made of ``map_board``, ``map_layers``, ``door_list``,
  ``door_row``, ``settings_dialog`` and ``prompts``.
"""
