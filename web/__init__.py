"""The page of ``closedrooms edit``: doors marked on a map in a browser, rooms predicted at once.

``server`` serves it to whom ``gate`` lets in. ``editing/`` is what a visitor does with a map and knows nothing of a
browser, ``page/`` draws that with NiceGUI.
"""
