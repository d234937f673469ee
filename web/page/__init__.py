"""What the browser shows of a session, drawn with NiceGUI.

``edit_page`` is made of ``map_board`` and ``map_layers`` (whose ``pictures`` encode maps), ``door_list`` and its
``door_row``, ``settings_dialog``, ``keyboard`` and ``prompts``.
"""
